"""Running: the missing cells as calls, batched into tasks, on workers here or elsewhere.

In come a plan and the index of a cache; out go packs with the results, failures, and how far it is.
A kind of executor is added here, beside those of `workers`, and named in `cluster`. The store, the
command and `function` may import it.
"""
