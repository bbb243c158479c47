# The values of blocks.rs, by scipy and statsmodels. The first argument is a file with what the test
# drawn_means prints (cargo test -p farside-experiments --lib drawn_means -- --ignored --nocapture).
import json, sys
import numpy as np
from scipy import stats
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

SKEWED = [
    1.2, 1.9, 1.4, 1.1, 3.0, 1.3, 1.25, 1.7, 2.2, 1.05, 1.15, 5.5, 1.33, 1.45, 1.6, 1.8, 1.02, 1.5,
    2.6, 1.9, 1.12, 1.21, 1.36, 4.1, 1.07, 1.66, 1.28, 1.42, 2.05, 1.55,
]
means = np.reshape(SKEWED, (6, 5)).mean(axis=1)


def drawn(path):
    line = next(line for line in open(path) if "[" in line and "," in line)
    return np.array(json.loads(line[line.index("[") : line.rindex("]") + 1]))


# Equal blocks: the mean of what is drawn is the mean of the blocks' means.
before = stats.bootstrap((means,), np.mean, n_resamples=1)
before.bootstrap_distribution = drawn(sys.argv[1])
bca = stats.bootstrap((means,), np.mean, n_resamples=0, method="BCa", bootstrap_result=before)
print("BCa", means.mean(), *bca.confidence_interval)

long = [0.01 + (at % 7 - 3) for at in range(1, 401)]
for values, expected in [
    (means, 1.0), (means, 1.75), (SKEWED, 0.0), (SKEWED, 1.5), ([0.5, 1.5], 0.0), (long, 0.3),
]:
    print("Student", repr(float(stats.ttest_1samp(values, expected).pvalue)))

p = [0.01, 0.04, 0.03, 0.005, 0.55, 0.04, 0.2]
print("Holm", *multipletests(p, method="holm")[1])

here = ["11110", "11111", "10100", "00000", "1110", "11111"]
there = ["10000", "11011", "00100", "00010", "1100", "01010"]
sums = np.array([a.count("1") - b.count("1") for a, b in zip(here, there)])
test = stats.permutation_test(
    (sums,), np.sum, permutation_type="samples", n_resamples=np.inf, alternative="two-sided"
)
print("permutation", repr(float(test.pvalue)))


def worth(sums, sizes, variance):
    m, n = len(sums), sum(sizes)
    away = np.array(sums) - sum(sums) / n * np.array(sizes)
    clustered = m / (m - 1) * (away**2).sum() / n**2
    return min(1.0, max(m / n, variance / n / clustered))


counts, sizes = [a.count("1") for a in here], [len(a) for a in here]
n, rate = sum(sizes), sum(counts) / sum(sizes)
share = worth(counts, sizes, rate * (1 - rate))
print("Wilson", rate, *proportion_confint(share * sum(counts), share * n, method="wilson"))
differences = [int(x) - int(y) for a, b in zip(here, there) for x, y in zip(a, b)]
print("worth", repr(float(worth(sums, sizes, np.var(differences)))))
