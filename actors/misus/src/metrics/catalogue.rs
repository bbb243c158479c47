//! What runs of MISUS can be measured by.

use farside_actors::system::Better::{Higher, Lower, Neither};
use farside_actors::system::Metric;
use farside_actors::system::MetricKind::{Number, Rate, Series};
use farside_actors::system::SeriesIndex;

/// Sorted by name.
pub(crate) const ALL: [Metric; 26] = [
    Metric::new("brown_outs", "brown-outs", "", Number, Lower),
    Metric::new(
        "class_ari",
        "adjusted Rand index of classes",
        "",
        Number,
        Higher,
    ),
    Metric::new(
        "class_ari_least",
        "the same of the worst rover",
        "",
        Number,
        Higher,
    ),
    Metric::new("distance_m", "distance driven", "m", Number, Neither),
    Metric::new(
        "distribution_error",
        "error of the distribution of classes",
        "",
        Number,
        Lower,
    ),
    Metric::new(
        "energy_imbalance",
        "energy not accounted for",
        "",
        Number,
        Lower,
    ),
    Metric::new(
        "exchange_bytes",
        "bytes of the exchange",
        "B",
        Number,
        Lower,
    ),
    Metric::new(
        "exchange_messages",
        "messages of the exchange",
        "messages",
        Number,
        Lower,
    ),
    Metric::new("faults", "faults of rovers", "", Number, Neither),
    Metric::new(
        "field_ari",
        "adjusted Rand index of the whole field",
        "",
        Number,
        Higher,
    ),
    Metric::new(
        "field_ari_by_sol",
        "adjusted Rand index of the whole field",
        "",
        Series(SeriesIndex::new("sol", "")),
        Higher,
    )
    .about("field_ari as it was at the end of each sol."),
    Metric::new("k", "classes told apart", "classes", Number, Neither),
    Metric::new(
        "k_agrees",
        "all rovers tell equally many apart",
        "",
        Rate,
        Higher,
    ),
    Metric::new(
        "log_likelihood",
        "log-likelihood of readings",
        "",
        Number,
        Neither,
    ),
    Metric::new(
        "log_score",
        "log score of the true story",
        "",
        Number,
        Higher,
    ),
    Metric::new("objective", "objective function", "", Number, Neither),
    Metric::new(
        "position_error_m",
        "error of the estimated position",
        "m",
        Number,
        Lower,
    ),
    Metric::new(
        "posterior_entropy",
        "entropy of a rock's class",
        "nat",
        Number,
        Lower,
    ),
    Metric::new(
        "readings",
        "readings that a rover knows",
        "readings",
        Number,
        Higher,
    ),
    Metric::new(
        "regret",
        "regret of the rock named richest",
        "",
        Number,
        Lower,
    ),
    Metric::new(
        "rocks_read",
        "rocks with a spectrum",
        "rocks",
        Number,
        Higher,
    ),
    Metric::new(
        "solar_wh",
        "energy of the solar arrays",
        "Wh",
        Number,
        Higher,
    ),
    Metric::new(
        "stops",
        "rocks that rovers set out for",
        "rocks",
        Number,
        Higher,
    ),
    Metric::new(
        "stored_wh",
        "energy stored at the end",
        "Wh",
        Number,
        Higher,
    ),
    Metric::new("unused_wh", "energy lost or not taken", "Wh", Number, Lower),
    Metric::new("used_wh", "energy used", "Wh", Number, Neither),
];
