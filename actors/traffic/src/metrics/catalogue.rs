//! What runs of traffic can be measured by.

use farside_actors::system::Better::{Higher, Lower, Neither};
use farside_actors::system::Metric;
use farside_actors::system::MetricKind::{Number, Sample};

/// Sorted by name.
pub(crate) const ALL: [Metric; 17] = [
    Metric::new(
        "age_of_information_mean_s",
        "age of information",
        "s",
        Number,
        Lower,
    ),
    Metric::new(
        "age_peak_s",
        "greatest age of information",
        "s",
        Number,
        Lower,
    ),
    Metric::new("delay_max_s", "longest delay", "s", Number, Lower),
    Metric::new("delay_mean_s", "mean delay", "s", Number, Lower),
    Metric::new("delay_p50_s", "median delay", "s", Number, Lower),
    Metric::new(
        "delay_p95_s",
        "95 % of delays are below",
        "s",
        Number,
        Lower,
    ),
    Metric::new("delays_s", "delays", "s", Sample, Lower),
    Metric::new(
        "delivered",
        "messages delivered",
        "messages",
        Number,
        Higher,
    ),
    Metric::new(
        "delivery_ratio",
        "share of messages delivered",
        "",
        Number,
        Higher,
    ),
    Metric::new(
        "duplicates",
        "duplicates received",
        "messages",
        Number,
        Neither,
    ),
    Metric::new("flows", "flows", "", Number, Neither),
    Metric::new("goodput_bit_per_s", "goodput", "bit/s", Number, Higher),
    Metric::new(
        "in_flight",
        "messages under way at the end",
        "messages",
        Number,
        Neither,
    ),
    Metric::new("lost", "messages lost", "messages", Number, Lower),
    Metric::new(
        "reordered",
        "messages received out of order",
        "messages",
        Number,
        Lower,
    ),
    Metric::new("sent", "messages sent", "messages", Number, Neither),
    Metric::new(
        "transmit_energy_j",
        "energy of transmissions",
        "J",
        Number,
        Lower,
    ),
];
