//! The statistics against those of scipy, statsmodels, lifelines and R, and what holds for any
//! values.

mod blocks;

use farside::random::RandomKey;
use proptest::prelude::*;

use super::bootstrap::{mean, mean_and_interquartile_mean, paired_difference, stratified};
use super::distribution::{Ecdf, quantile};
use super::rates::{mcnemar, paired_rate_difference, wilson};
use super::survival::{Observation, Survival, kaplan_meier};
use super::{Blocks, Estimate};

/// Skewed, as times on bad links are.
const SKEWED: [f64; 30] = [
    1.2, 1.9, 1.4, 1.1, 3.0, 1.3, 1.25, 1.7, 2.2, 1.05, 1.15, 5.5, 1.33, 1.45, 1.6, 1.8, 1.02, 1.5,
    2.6, 1.9, 1.12, 1.21, 1.36, 4.1, 1.07, 1.66, 1.28, 1.42, 2.05, 1.55,
];

/// Each pair a block.
fn alone<T: Copy>(pairs: &[T]) -> Vec<Vec<T>> {
    pairs.iter().map(|pair| vec![*pair]).collect()
}

fn key() -> RandomKey {
    RandomKey::new(0).text("test")
}

#[track_caller]
fn close(found: Estimate, value: f64, low: f64, high: f64, tolerance: f64) {
    let near = |a: f64, b: f64, by: f64| (a - b).abs() <= by;
    let ends = near(found.low, low, tolerance) && near(found.high, high, tolerance);
    assert!(
        near(found.value, value, 1e-9) && ends,
        "{found:?}, not {value} [{low}, {high}]"
    );
}

/// `scipy.stats.bootstrap((v,), statistic, n_resamples=400000, method="BCa")` of scipy 1.17.1, with
/// `np.mean` and `trim_mean(v, 0.25)`. With 2000 draws the ends move by some hundredths.
#[test]
fn bootstrap_agrees_with_scipy() {
    let (mean, middle) = mean_and_interquartile_mean(&SKEWED, key());
    close(mean, 1.759, 1.5093, 2.2540, 0.05);
    close(middle, 1.481875, 1.3225, 1.716875, 0.03);
    let reversed = SKEWED.iter().rev().enumerate();
    let others = reversed.map(|(at, value)| value * 0.9 + 0.05 * at as f64);
    let pairs: Vec<(f64, f64)> = SKEWED.iter().copied().zip(others).collect();
    let pairs = alone(&pairs);
    close(
        paired_difference(&pairs, key()),
        -0.5491,
        -0.9581,
        -0.1046,
        0.04,
    );
}

/// What rliable does, in numpy: 400000 times `cell[rng.integers(0, 10, 10)]` of each of three
/// cells, the percentiles 2.5 and 97.5 of the means and of `trim_mean(pool, 0.25)`.
#[test]
fn stratified_bootstrap_agrees_with_numpy() {
    let cells = [
        SKEWED[..10].to_vec(),
        SKEWED[10..20].iter().map(|value| value + 2.0).collect(),
        SKEWED[20..].iter().map(|value| value * 3.0).collect(),
    ];
    let overall = stratified(&cells.each_ref().map(Blocks::from), key());
    close(overall.mean, 3.547, 3.0417, 4.2183, 0.06);
    close(overall.interquartile_mean, 3.310625, 3.0863, 3.6031, 0.03);
}

/// Of many intervals 95 in 100 hold the true mean; those of 30 skewed values somewhat fewer.
#[test]
fn intervals_hold_the_truth_about_as_often_as_they_say() {
    let trials = 400;
    let held = (0..trials).filter(|trial| {
        let mut stream = RandomKey::new(9).number(*trial).stream();
        let values: Vec<f64> = (0..30).map(|_| stream.exponential(2.0)).collect();
        let estimate = mean(&values, RandomKey::new(10).number(*trial));
        estimate.low <= 2.0 && 2.0 <= estimate.high
    });
    let share = held.count() as f64 / trials as f64;
    assert!((0.91..=0.97).contains(&share), "{share}");
}

/// `statsmodels.stats.proportion.proportion_confint(k, n, method="wilson")`, statsmodels 0.15.0.
#[test]
fn wilson_agrees_with_statsmodels() {
    let cases = [
        (0, 300, 0.0, 0.01264297122454604),
        (3, 30, 0.03459988874733416, 0.25621082579184085),
        (15, 30, 0.3315412564053376, 0.6684587435946624),
        (30, 30, 0.8864866068260311, 1.0),
        (1, 7, 0.02567962434474355, 0.5131278292743189),
    ];
    for (happened, n, low, high) in cases {
        let rate = happened as f64 / n as f64;
        close(wilson(happened, n), rate, low, high, 1e-14);
    }
}

/// `statsmodels.stats.contingency_tables.mcnemar([[10, b], [c, 4]], exact=True).pvalue`,
/// statsmodels 0.15.0.
#[test]
fn mcnemar_agrees_with_statsmodels() {
    let cases = [
        (8, 0, 0.0078125),
        (3, 9, 0.14599609375),
        (5, 5, 1.0),
        (1, 12, 0.00341796875),
        (600, 700, 0.0060157938610449395),
    ];
    for (first, second, p) in cases {
        let mut pairs = vec![(true, true); 10];
        pairs.extend(vec![(true, false); first]);
        pairs.extend(vec![(false, true); second]);
        let test = mcnemar(&pairs);
        assert_eq!((test.only_first, test.only_second), (first, second));
        assert!((test.p - p).abs() < 1e-10, "{test:?}, not {p}");
    }
}

/// Pairs that go together, as runs of one seed do: the first holds with 0.8, the second with 0.6,
/// and never the second alone.
#[test]
fn paired_rates_hold_the_truth_about_as_often_as_they_say() {
    let trials = 2000;
    let held = (0..trials).filter(|trial| {
        let mut stream = RandomKey::new(11).number(*trial).stream();
        let pairs: Vec<(bool, bool)> = (0..30)
            .map(|_| {
                let draw = stream.uniform();
                (draw < 0.8, draw < 0.6)
            })
            .collect();
        let test = mcnemar(&pairs);
        let there = paired_rate_difference(&test);
        let swapped: Vec<(bool, bool)> = pairs.iter().map(|(a, b)| (*b, *a)).collect();
        let back = paired_rate_difference(&mcnemar(&swapped));
        close(there, -back.value, -back.high, -back.low, 1e-12);
        there.low <= 0.2 && 0.2 <= there.high
    });
    let share = held.count() as f64 / trials as f64;
    assert!((0.92..=0.98).contains(&share), "{share}");
}

fn singles(times: &[f64], happened: &[u8]) -> Vec<Observation> {
    let pairs = times.iter().zip(happened).enumerate();
    let one = |(group, (time, happened)): (usize, (&f64, &u8))| Observation {
        time: *time,
        happened: *happened == 1,
        group,
    };
    pairs.map(one).collect()
}

/// `lifelines.KaplanMeierFitter().fit(t, e)`, lifelines 0.30.3, whose intervals are Greenwood's
/// over log(-log): the remission times of Freireich and others (1963).
#[test]
fn kaplan_meier_agrees_with_lifelines() {
    let times = [
        6., 6., 6., 6., 7., 9., 10., 10., 11., 13., 16., 17., 19., 20., 22., 23., 25., 32., 32.,
        34., 35.,
    ];
    let happened = [
        1, 1, 1, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0,
    ];
    let curve = kaplan_meier(&singles(&times, &happened));
    let expected = [
        (6.0, 0.857142857143, 0.619717955266, 0.951551747647),
        (7.0, 0.806722689076, 0.563146564622, 0.922809019203),
        (10.0, 0.752941176471, 0.503199510800, 0.889361835169),
        (13.0, 0.690196078431, 0.431610222486, 0.849065963349),
        (16.0, 0.627450980392, 0.367510855988, 0.804912189472),
        (22.0, 0.537815126050, 0.267778936767, 0.746790717635),
        (23.0, 0.448179271709, 0.188052005959, 0.680142628495),
    ];
    assert_eq!(curve.steps.len(), expected.len());
    for (step, (time, value, low, high)) in curve.steps.iter().zip(expected) {
        assert_eq!(step.time, time);
        close(step.remaining, value, low, high, 1e-9);
    }
    let median = curve.median();
    assert_eq!((median.value, median.low), (23.0, 13.0));
    assert_eq!(median.high, f64::INFINITY);
    assert_eq!((curve.watched, curve.happened, curve.until), (21, 9, 35.0));
}

/// Four runs of six rovers: `survfit(Surv(t, e) ~ 1, cluster = g, conf.type = "log-log", robust =
/// TRUE)` of R's survival 3.5-3.
#[test]
fn kaplan_meier_with_groups_agrees_with_r() {
    let times = [
        [3., 5., 5., 8., 9., 12.],
        [2., 4., 4., 6., 7., 15.],
        [5., 9., 11., 14., 15., 15.],
        [1., 2., 3., 3., 4., 6.],
    ];
    let censored = [(0, 12.0), (1, 15.0), (2, 15.0)];
    let grouped = times.iter().enumerate().flat_map(|(group, times)| {
        times.iter().map(move |time| Observation {
            time: *time,
            happened: !censored.contains(&(group, *time)),
            group,
        })
    });
    let curve = kaplan_meier(&grouped.collect::<Vec<_>>());
    let expected = [
        (1.0, 0.958333333333, 0.7858179030548, 0.992513253855),
        (2.0, 0.875, 0.6534020370052, 0.958966670003),
        (3.0, 0.75, 0.4084159131516, 0.911720406126),
        (5.0, 0.5, 0.2592887874653, 0.700514320000),
        (9.0, 0.25, 0.0601445557333, 0.504758833298),
        (14.0, 0.15625, 0.0642614513365, 0.284959124902),
    ];
    for (time, value, low, high) in expected {
        close(curve.at(time), value, low, high, 1e-9);
    }
}

/// `numpy.quantile(v, q)`, and what the words say.
#[test]
fn quantiles_agree_with_numpy() {
    let ecdf = Ecdf::new(&SKEWED);
    for (q, value) in [(0.1, 1.097), (0.25, 1.22), (0.5, 1.435), (0.99, 5.094)] {
        assert!((ecdf.quantile(q) - value).abs() < 1e-12, "{q}");
    }
    assert_eq!(ecdf.at(1.9), 24.0 / 30.0);
    assert_eq!(ecdf.steps().last(), Some((5.5, 1.0)));
    assert_eq!(ecdf.steps().count(), 29);
}

#[test]
fn little_or_nothing_gives_a_defined_answer() {
    for values in [&[][..], &[f64::NAN, f64::INFINITY]] {
        let (mean, middle) = mean_and_interquartile_mean(values, key());
        assert!(mean.value.is_nan() && middle.value.is_nan() && !mean.is_known());
        assert_eq!(mean.width(), f64::INFINITY);
    }
    assert_eq!(mean(&[4.0], key()), Estimate::unknown(4.0));
    let same = mean(&[0.1; 30], key());
    assert_eq!((same.value, same.low, same.high), (0.1, 0.1, 0.1));
    assert!(stratified(&[], key()).mean.value.is_nan());
    assert!(
        !stratified(&[(&[1.0]).into(), (&[2.0]).into()], key())
            .mean
            .is_known()
    );
    assert_eq!((wilson(0, 0).low, wilson(0, 0).high), (0.0, 1.0));
    assert_eq!(mcnemar(&[]).p, 1.0);
    assert!(quantile(&[], 0.5).is_nan());
    assert_eq!(Ecdf::new(&[]).at(3.0), 0.0);
    let nothing = kaplan_meier(&[]);
    assert!(nothing.steps.is_empty() && nothing.median().value.is_nan());
    let never = kaplan_meier(&singles(&[f64::INFINITY, f64::INFINITY], &[0, 0]));
    assert_eq!((never.at(1e9).value, never.until), (1.0, 0.0));
    assert_eq!(never.median().value, f64::INFINITY);
    assert!(
        kaplan_meier(&singles(&[f64::NAN, -1.0], &[1, 1]))
            .steps
            .is_empty()
    );
}

/// Rovers of one run say together as much as the run does.
#[test]
fn one_run_says_nothing_of_how_runs_differ() {
    let mut rovers = singles(&[1.0, 2.0, 3.0], &[1, 1, 0]);
    for rover in &mut rovers {
        rover.group = 7;
    }
    let share = kaplan_meier(&rovers).at(1.5);
    assert_eq!((share.low, share.high), (0.0, 1.0));
    // Each run ten times over, all rovers of a run alike: no surer than with one of each.
    let alone = singles(&[1.0, 2.0, 3.0, 4.0, 5.0], &[1, 1, 0, 1, 1]);
    let many: Vec<Observation> = (0..10).flat_map(|_| alone.clone()).collect();
    let (alone, many) = (kaplan_meier(&alone).at(2.0), kaplan_meier(&many).at(2.0));
    close(many, alone.value, alone.low, alone.high, 0.02);
}

fn values() -> impl Strategy<Value = Vec<f64>> {
    prop_oneof![
        prop::collection::vec(-1e3..1e3f64, 0..40),
        // Lumpy: nearly all values are equal.
        prop::collection::vec(prop_oneof![4 => Just(0.0), 1 => 0.0..9.0f64], 0..40),
    ]
}

fn holds(estimate: &Estimate) -> bool {
    estimate.value.is_nan() || (estimate.low <= estimate.value && estimate.value <= estimate.high)
}

fn steps(survival: &Survival) -> impl Iterator<Item = (f64, f64)> {
    let steps = survival.steps.iter();
    steps.map(|step| (step.time, 1.0 - step.remaining.value))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn intervals_hold_their_estimates(values in values(), others in values()) {
        let (mean, middle) = mean_and_interquartile_mean(&values, key());
        prop_assert!(holds(&mean) && holds(&middle));
        let overall = stratified(&[(&values).into(), (&others).into()], key());
        prop_assert!(holds(&overall.mean) && holds(&overall.interquartile_mean));
        let pairs: Vec<(f64, f64)> = values.into_iter().zip(others).collect();
        prop_assert!(holds(&paired_difference(&alone(&pairs), key())));
    }

    #[test]
    fn order_changes_nothing(values in values()) {
        let mut shuffled = values.clone();
        key().text("order").stream().shuffle(&mut shuffled);
        let bits = |(a, b): (Estimate, Estimate)| {
            [a.value, a.low, a.high, b.value, b.low, b.high].map(f64::to_bits)
        };
        prop_assert_eq!(
            bits(mean_and_interquartile_mean(&values, key())),
            bits(mean_and_interquartile_mean(&shuffled, key()))
        );
        let cells = |values: &[f64]| stratified(&[values.into(), (&[1.0, 2.0]).into()], key());
        prop_assert_eq!(cells(&values), cells(&shuffled));
    }

    #[test]
    fn more_values_narrow_an_interval(values in prop::collection::vec(0.0..1e3f64, 8..20)) {
        let often = values.repeat(9);
        // To a third, if it were not for what is drawn.
        let (few, many) = (mean(&values, key()), mean(&often, key()));
        prop_assert!(many.width() < 0.5 * few.width(), "{few:?} {many:?}");
        let (few, many) = (&values, &often);
        let [few, many] = [few, many].map(|values| stratified(&[values.into()], key()));
        prop_assert!(many.mean.width() < 0.5 * few.mean.width());
    }

    #[test]
    fn a_cell_does_not_differ_from_itself(values in prop::collection::vec(-1e9..1e9f64, 2..40)) {
        let pairs: Vec<(f64, f64)> = values.iter().map(|value| (*value, *value)).collect();
        let zero = Estimate { value: 0.0, low: 0.0, high: 0.0 };
        prop_assert_eq!(paired_difference(&alone(&pairs), key()), zero);
    }

    #[test]
    fn rates_hold_and_narrow(happened in 0usize..200, more in 0usize..200) {
        let n = happened + more;
        let rate = wilson(happened, n);
        prop_assert!(holds(&rate) && rate.low >= 0.0 && rate.high <= 1.0);
        if n > 0 {
            prop_assert!(wilson(4 * happened, 4 * n).width() < rate.width());
        }
    }

    #[test]
    fn without_censoring_survival_is_the_distribution(times in prop::collection::vec(0.0..50.0f64, 1..40)) {
        let curve = kaplan_meier(&singles(&times, &vec![1; times.len()]));
        let ecdf = Ecdf::new(&times);
        prop_assert_eq!(curve.steps.len(), ecdf.steps().count());
        for ((time, share), (value, expected)) in steps(&curve).zip(ecdf.steps()) {
            prop_assert_eq!(time, value);
            prop_assert!((share - expected).abs() < 1e-12);
        }
    }

    /// Groups of one give Greenwood's formula, written down another way.
    #[test]
    fn groups_of_one_are_greenwoods(
        times in prop::collection::vec(0u8..20, 2..40),
        happened in prop::collection::vec(0u8..2, 40),
    ) {
        let times: Vec<f64> = times.iter().map(|time| f64::from(*time)).collect();
        let curve = kaplan_meier(&singles(&times, &happened));
        let mut variance = 0.0;
        for step in curve.steps.iter().filter(|step| step.remaining.value > 0.0) {
            let (risk, events) = (step.at_risk as f64, step.happened as f64);
            variance += events / (risk * (risk - events));
            let log = libm::log(step.remaining.value);
            let reach = libm::exp(super::Z_95 * libm::sqrt(variance) / log.abs());
            prop_assert!((step.remaining.low - libm::exp(log * reach)).abs() < 1e-9);
            prop_assert!((step.remaining.high - libm::exp(log / reach)).abs() < 1e-9);
        }
    }
}
