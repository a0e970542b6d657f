"""Private names of scikit-learn, all in this module.

`_fit_context` and the constraints of `_param_validation` check the parameters of an estimator and
word errors like scikit-learn's own estimators. They have no public equivalent, and scikit-learn's
template of estimators uses them. They are unchanged in versions 1.6 to 1.9.
"""

from sklearn.base import _fit_context as fit_context
from sklearn.utils._param_validation import Interval, StrOptions

__all__ = ["Interval", "StrOptions", "fit_context"]
