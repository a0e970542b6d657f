"""AUROC and OSCR agree with chance, scikit-learn, and the area under an explicit curve."""

import numpy as np
import pytest
from sklearn.metrics import roc_auc_score

from ncti.evaluate import open_set_scores


def test_equal_similarities_score_at_chance_level():
    known, right = np.arange(90) < 60, np.arange(90) < 45
    scores = open_set_scores(np.full(90, 0.7), right, known)
    assert (scores.auroc, scores.oscr) == (0.5, 45 / 60 / 2)


@pytest.mark.parametrize("seed", range(3))
def test_auroc_matches_scikit_learn_and_oscr_curve_area(seed):
    """Answers include ties; the expected curve has a point for each threshold."""
    rng = np.random.default_rng(seed)
    similarity = rng.integers(0, 30, (5, 40)) / 30
    known, right = (rng.random(similarity.shape) < share for share in (0.7, 0.6))
    scores = open_set_scores(similarity, right, known)
    assert scores.auroc == pytest.approx(roc_auc_score(known.ravel(), similarity.ravel()))
    correct, through = [0.0], [0.0]
    for threshold in np.unique(similarity)[::-1]:
        accepted = similarity >= threshold
        correct.append((accepted & right)[known].mean())
        through.append(accepted[~known].mean())
    assert scores.oscr == pytest.approx(np.trapezoid(correct, through))


@pytest.mark.parametrize("known", [[True, True], [False, False], []])
def test_scores_are_nan_without_known_and_unknown(known):
    scores = open_set_scores(np.ones(len(known)), np.ones(len(known), bool), np.array(known, bool))
    assert np.isnan([scores.auroc, scores.oscr]).all()
