//! What a run can be measured by: names, labels, units, kinds, and which way is better.

/// How the values of a metric are summed up over runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MetricKind {
    /// A number for each run: the mean, with an interval.
    Number,
    /// True or false for each run: a rate, with an interval.
    Rate,
    /// A word for each run: how often each.
    Word,
    /// A list of numbers for each run, one for each rover, say: a distribution, and survival where
    /// entries are missing.
    Sample,
    /// A curve for each run ([`Series`](super::Series)): the mean at each index, with a band.
    Series(SeriesIndex),
}

/// What the index of a curve is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeriesIndex {
    /// What plots write along the axis: `planning step`.
    pub label: &'static str,
    /// Its unit, empty for none.
    pub unit: &'static str,
    /// Some runs of a cell may end at an earlier index than others. All have the same indices as
    /// far as they go.
    pub lengths_differ: bool,
}

impl SeriesIndex {
    /// An index that all runs have as far as each other.
    pub const fn new(label: &'static str, unit: &'static str) -> Self {
        SeriesIndex {
            label,
            unit,
            lengths_differ: false,
        }
    }
}

/// Which way a metric is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// The more the better.
    Higher,
    /// The less the better.
    Lower,
    /// It depends.
    Neither,
}

/// A metric that a system's runs have.
///
/// ```
/// use farside_actors::system::{Better, Metric, MetricKind};
/// const HEARD: Metric = Metric::number("heard", "pings heard", "pings", Better::Higher)
///     .about("How many pings the base has heard, copies not counted.");
/// assert_eq!((HEARD.kind, HEARD.unit), (MetricKind::Number, "pings"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Metric {
    /// Its name among a run's results; it carries its unit.
    pub name: &'static str,
    /// What axes and tables call it.
    pub label: &'static str,
    /// Its unit; empty for a ratio or a count of nothing in particular.
    pub unit: &'static str,
    /// How it is summed up.
    pub kind: MetricKind,
    /// Which way is better.
    pub better: Better,
    /// What it is, in a sentence or two.
    pub about: &'static str,
    /// Where it is from: a paper and its section; empty if it is Farside's own.
    pub source: &'static str,
}

impl Metric {
    /// A metric of some kind.
    pub const fn new(
        name: &'static str,
        label: &'static str,
        unit: &'static str,
        kind: MetricKind,
        better: Better,
    ) -> Self {
        Metric {
            name,
            label,
            unit,
            kind,
            better,
            about: "",
            source: "",
        }
    }

    /// A number for each run.
    pub const fn number(
        name: &'static str,
        label: &'static str,
        unit: &'static str,
        better: Better,
    ) -> Self {
        Metric::new(name, label, unit, MetricKind::Number, better)
    }

    /// True or false for each run.
    pub const fn rate(name: &'static str, label: &'static str, better: Better) -> Self {
        Metric::new(name, label, "", MetricKind::Rate, better)
    }

    /// A curve for each run.
    pub const fn series(
        name: &'static str,
        label: &'static str,
        unit: &'static str,
        index: SeriesIndex,
        better: Better,
    ) -> Self {
        Metric::new(name, label, unit, MetricKind::Series(index), better)
    }

    /// With what it is, in a sentence or two.
    #[must_use]
    pub const fn about(mut self, about: &'static str) -> Self {
        self.about = about;
        self
    }

    /// With where it is from.
    #[must_use]
    pub const fn source(mut self, source: &'static str) -> Self {
        self.source = source;
        self
    }
}
