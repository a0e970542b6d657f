"""With this file here, pytest lets every test import the helpers of this folder: `reference`."""
