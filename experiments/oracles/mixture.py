"""Classes of rock that scikit-learn finds, beside those of Farside, on the same features.

    python mixture.py                   learns 30 fields with both, and prints a table
    python mixture.py FILE              reads what the example wrote, instead of running it

The features come from `cargo run --release -p farside-misus --example mixture_fields`: a field on
each line, as JSON. scikit-learn's `GaussianMixture` has diagonal covariances and ten starts, and takes the
number of classes (1 to 10) of the least BIC; once on the features as they are, and once on columns of
unit variance, since its starts are those of k-means.

Its log-likelihood of Farside's parameters has to be Farside's, to 1e-9 for each rock.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import warnings

import numpy as np
from sklearn.metrics import adjusted_rand_score
from sklearn.mixture import GaussianMixture
from sklearn.preprocessing import StandardScaler

ROOT = pathlib.Path(__file__).resolve().parents[2]
COMMAND = ["cargo", "run", "--release", "-q", "-p", "farside-misus", "--example", "mixture_fields"]
MAX_CLASSES = 10


def learn(features):
    """The classes of the least BIC."""
    fits = []
    for classes in range(1, MAX_CLASSES + 1):
        mixture = GaussianMixture(classes, covariance_type="diag", n_init=10, random_state=0)
        fits.append(mixture.fit(features))
    best = min(fits, key=lambda mixture: mixture.bic(features))
    return best.n_components, best.predict(features)


def log_likelihood(features, parameters):
    """scikit-learn's log-likelihood of given parameters."""
    mixture = GaussianMixture(len(parameters["weights"]), covariance_type="diag")
    mixture.weights_ = np.array(parameters["weights"])
    mixture.means_ = np.array(parameters["means"])
    mixture.covariances_ = np.array(parameters["variances"])
    mixture.precisions_cholesky_ = 1.0 / np.sqrt(mixture.covariances_)
    return mixture.score(features) * len(features)


def decile(values):
    """The largest of the worst tenth."""
    return sorted(values)[len(values) // 10 - 1]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", nargs="?", help="what the example wrote")
    arguments = parser.parse_args()
    if arguments.file:
        lines = pathlib.Path(arguments.file).read_text().splitlines()
    else:
        run = subprocess.run(COMMAND, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
        lines = run.stdout.splitlines()
    warnings.filterwarnings("ignore", category=UserWarning)
    print("field story    stretched | K: ours raw scaled | ARI: ours   raw scaled | log-likelihood differs")
    ours, raw, scaled = [], [], []
    near = {"raw": 0, "scaled": 0}
    worst = 0.0
    for line in lines:
        field = json.loads(line)
        features = np.array(field["features"])
        truth = field["truth"]
        raw_k, raw_classes = learn(features)
        scaled_k, scaled_classes = learn(StandardScaler().fit_transform(features))
        expected = log_likelihood(features, field["plain"])
        difference = abs(expected - field["plain_log_likelihood"]) / len(features)
        worst = max(worst, difference)
        ari = adjusted_rand_score(truth, field["classes"])
        assert abs(ari - field["ari"]) < 1e-12, "the adjusted Rand index is another"
        ours.append(ari)
        raw.append(adjusted_rand_score(truth, raw_classes))
        scaled.append(adjusted_rand_score(truth, scaled_classes))
        near["raw"] += abs(field["k"] - raw_k) <= 1
        near["scaled"] += abs(field["k"] - scaled_k) <= 1
        print(
            f"{field['field']:5} {field['story']:8} {'yes' if field['stretched'] else 'no ':9} |"
            f" {field['k']:7} {raw_k:3} {scaled_k:6} |"
            f" {ari:9.3f} {raw[-1]:5.3f} {scaled[-1]:6.3f} | {difference:.1e}"
        )
    count = len(lines)
    print(
        f"mean ARI {np.mean(ours):.3f}, scikit-learn {np.mean(raw):.3f} and {np.mean(scaled):.3f};"
        f" worst decile {decile(ours):.3f}, {decile(raw):.3f} and {decile(scaled):.3f}"
    )
    print(
        f"K within one of scikit-learn's in {near['raw']} and {near['scaled']} of {count};"
        f" log-likelihoods differ by {worst:.1e} for each rock at most"
    )
    failed = []
    if worst > 1e-9:
        failed.append("the log-likelihood is another")
    if np.mean(ours) < max(np.mean(raw), np.mean(scaled)) - 0.01:
        failed.append("scikit-learn finds classes better")
    if max(near.values()) < 0.9 * count:
        failed.append("the numbers of classes are others")
    if np.mean(ours) < 0.9:
        failed.append("the mean ARI is below 0.9")
    for reason in failed:
        print(f"failed: {reason}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
