//! What a study leaves behind: a manifest, which holds all that it takes to run any part of the
//! study again, and one record for each run.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The version of the results format. A folder of another version is refused.
pub const FORMAT: u32 = 1;

/// Everything it takes to run any (cell, seed) of a study again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`FORMAT`].
    pub format: u32,
    /// The version of the code that ran it.
    pub code_version: String,
    /// The study's name: a built-in name, or the file's name without its ending.
    pub study: String,
    /// What the study asks, in a sentence.
    pub question: String,
    /// The scenario's name.
    pub scenario: String,
    /// The scenario with all defaults filled in and what the study sets laid over it, as TOML. A
    /// cell's run is this with [`Cell::sets`] laid over it.
    pub scenario_text: String,
    /// The files that the scenario reads, by name.
    #[serde(with = "file_texts")]
    pub files: BTreeMap<String, Vec<u8>>,
    /// What is varied.
    pub factors: Vec<Factor>,
    /// What is measured, in the order of tables.
    pub metrics: Vec<Metric>,
    /// The cell that others are compared with.
    pub baseline: Option<usize>,
    /// The cells; records name them by their place here.
    pub cells: Vec<Cell>,
    /// The seeds, the same for each cell; with a stopping rule, the most there may be.
    pub seeds: Vec<u64>,
    /// How many seeds, in the order of [`Manifest::seeds`], share a problem: 1 if none do.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub block: usize,
    /// When a cell has seeds enough; without, each cell runs with all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<Stop>,
    /// Figures of others, to set ours beside. They say nothing about what is run: a folder's runs
    /// are kept when these change.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub published: Vec<Published>,
    /// Which factors plots put where. It says nothing about what is run: a folder's runs are kept
    /// when it changes.
    #[serde(default, skip_serializing_if = "PlotAxes::is_open")]
    pub report: PlotAxes,
}

farside_actors::documented! {
    /// Which factors plots put where, each by its name; what is left open follows from the factors.
    #[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct PlotAxes {
        /// The factor along the horizontal axis; the first of numbers unless given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub x: Option<String>,
        /// The factor with a curve for each of its values; the next one unless given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub series: Option<String>,
        /// The factor with a plot for each of its values; any further one unless given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub facet: Option<String>,
    }
}

impl PlotAxes {
    /// What is said, by key.
    pub fn said(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let all = [
            ("x", &self.x),
            ("series", &self.series),
            ("facet", &self.facet),
        ];
        all.into_iter()
            .filter_map(|(key, name)| Some((key, name.as_deref()?)))
    }

    fn is_open(&self) -> bool {
        *self == PlotAxes::default()
    }
}

fn one() -> usize {
    1
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_one(block: &usize) -> bool {
    *block == 1
}

impl Manifest {
    /// The seed of the problem that the run with this seed has: without blocks its own, which
    /// is none here; with blocks, the first seed of its block.
    pub fn problem_seed(&self, seed: u64) -> Option<u64> {
        if self.block <= 1 {
            return None;
        }
        let place = self.seeds.iter().position(|known| *known == seed)?;
        self.seeds.get(place - place % self.block).copied()
    }
}

/// When a cell has seeds enough.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// The metric whose interval decides.
    pub metric: String,
    /// The widest that its 95 % interval may be, in the metric's unit.
    pub width: f64,
    /// How many seeds each cell runs with before it is looked at.
    pub min_seeds: usize,
}

/// Files in a manifest: as text where they are text, for people to read, else as bytes.
mod file_texts {
    use std::collections::BTreeMap;

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    #[serde(untagged)]
    enum Content {
        Text(String),
        Bytes(Vec<u8>),
    }

    pub(super) fn serialize<S: Serializer>(
        files: &BTreeMap<String, Vec<u8>>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.collect_map(files.iter().map(|(name, bytes)| {
            let content = match std::str::from_utf8(bytes) {
                Ok(text) => Content::Text(text.to_owned()),
                Err(_) => Content::Bytes(bytes.clone()),
            };
            (name, content)
        }))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<BTreeMap<String, Vec<u8>>, D::Error> {
        let files = BTreeMap::<String, Content>::deserialize(from)?;
        let bytes = |content| match content {
            Content::Text(text) => text.into_bytes(),
            Content::Bytes(bytes) => bytes,
        };
        Ok(files
            .into_iter()
            .map(|(name, content)| (name, bytes(content)))
            .collect())
    }
}

/// What is varied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// A short name: the column in tables (`loss`).
    pub name: String,
    /// What plots write on the axis (`message loss`).
    pub label: String,
    /// The unit of numeric values, empty for none (`s`, `messages`).
    pub unit: String,
    /// How plots space the values.
    pub scale: Scale,
}

/// How a plot spaces the values of a factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Evenly.
    #[default]
    Linear,
    /// By ratio; values must be positive.
    Log,
}

/// One combination of factor values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// The value of each factor, in base units if it is a quantity (a latency of `"600ms"` is 0.6),
    /// as text if it is none.
    pub values: Vec<Value>,
    /// The same as people write it, in the same order (`"600ms"`).
    pub texts: Vec<String>,
    /// The `--set` arguments that make the cell of the scenario.
    pub sets: Vec<String>,
}

/// What is measured. What a run reports under the metric's name decides how it is summed up:
/// a number by its mean, true or false as a rate, a list of numbers as a distribution (`null`: it
/// had not happened when the run ended), a curve ([`farside_actors::system::Series`]) index by
/// index.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Metric {
    /// The name in a run's metrics; `messages.lost` and the like for what the kernel counts.
    pub name: String,
    /// What plots and tables write.
    pub label: String,
    /// The unit, empty for none.
    pub unit: String,
    /// What the index of a curve is. None of a metric that is no curve, or of which nobody says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub index: Option<SeriesIndex>,
    /// What its system declares it to be. None of a metric that no system declares: then its values
    /// tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<DeclaredKind>,
    /// Which way is better, as its system declares it. None if neither way is, and of a metric that
    /// no system declares.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub better: Option<DeclaredBetter>,
}

/// Which way a metric is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeclaredBetter {
    /// The more the better.
    Higher,
    /// The less the better.
    Lower,
}

impl DeclaredBetter {
    /// What a system declares; none where neither way is better.
    ///
    /// ```
    /// use farside_actors::system::Better;
    /// use farside_experiments::study::results::DeclaredBetter;
    /// assert_eq!(DeclaredBetter::of(Better::Lower), Some(DeclaredBetter::Lower));
    /// assert_eq!(DeclaredBetter::of(Better::Neither), None);
    /// ```
    pub fn of(better: farside_actors::system::Better) -> Option<Self> {
        use farside_actors::system::Better;
        match better {
            Better::Higher => Some(DeclaredBetter::Higher),
            Better::Lower => Some(DeclaredBetter::Lower),
            Better::Neither => None,
        }
    }
}

/// How the values of a metric are summed up over runs, as its system says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeclaredKind {
    /// Numbers, by their mean.
    Number,
    /// True or false, as a rate.
    Rate,
    /// Lists of numbers, as a distribution.
    List,
    /// Curves, index by index.
    Series,
    /// Words, which are counted.
    Word,
}

impl DeclaredKind {
    /// Whether a run's value is of this kind; `null` is of each.
    ///
    /// ```
    /// use farside_experiments::study::results::DeclaredKind;
    /// assert!(DeclaredKind::Rate.holds(&true.into()));
    /// assert!(!DeclaredKind::Number.holds(&"many".into()));
    /// ```
    pub fn holds(self, value: &serde_json::Value) -> bool {
        match self {
            _ if value.is_null() => true,
            DeclaredKind::Number => value.is_number(),
            DeclaredKind::Rate => value.is_boolean(),
            DeclaredKind::List => value.is_array(),
            DeclaredKind::Series => value.is_object(),
            DeclaredKind::Word => value.is_string(),
        }
    }
}

impl From<farside_actors::system::MetricKind> for DeclaredKind {
    fn from(kind: farside_actors::system::MetricKind) -> Self {
        use farside_actors::system::MetricKind;
        match kind {
            MetricKind::Number => DeclaredKind::Number,
            MetricKind::Rate => DeclaredKind::Rate,
            MetricKind::Word => DeclaredKind::Word,
            MetricKind::Sample => DeclaredKind::List,
            MetricKind::Series(_) => DeclaredKind::Series,
        }
    }
}

/// What the index of a curve is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeriesIndex {
    /// What plots write along the axis (`planning step`).
    pub label: String,
    /// The unit, empty for none.
    pub unit: String,
    /// Some runs of a cell may end at an earlier index than others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lengths_differ: bool,
}

/// Figures of one metric that others published.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// The metric's name in [`Manifest::metrics`].
    pub metric: String,
    /// What it is called there (`Table 1: deadlocks`).
    pub title: String,
    /// Whose it is, and where it stands.
    pub source: String,
    /// The unit that the published figures are in (`%`), empty for none.
    pub unit: String,
    /// A published figure is ours times this: 100 for a share that is published in percent.
    pub scale: f64,
    /// The factor whose levels make the rows where figures are shown as a table of two factors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<String>,
    /// The figures.
    pub figures: Vec<PublishedFigure>,
    /// How to read them.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub note: String,
    /// Why ours differ.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub why: String,
}

/// A published figure, and the cells in which it should hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedFigure {
    /// By place in [`Manifest::cells`].
    pub cells: Vec<usize>,
    /// What is claimed.
    pub claim: Claim,
    /// In the publication's own words, if it was not a table.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub quote: String,
}

/// What a publication says of a metric, in the publication's unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Claim {
    /// A figure.
    Value(f64),
    /// A figure that is said to be rough.
    About(f64),
    /// Less than this.
    Below(f64),
    /// More than this.
    Above(f64),
    /// That it grows, or falls, linearly with a factor, which is named.
    Linear(String),
    /// That it is more than in another cell, or as much, with the same seeds.
    Exceeds(Comparison),
}

/// What a publication says of the difference of a cell to another, in the publication's unit: that
/// it is above 0, unless `equal_within` says how near to 0 it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// The other cell of each of [`PublishedFigure::cells`].
    pub others: Vec<usize>,
    /// For curves: the first index at which it is claimed, and from there on at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_index: Option<f64>,
    /// The least difference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_at_least: Option<f64>,
    /// The greatest difference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_at_most: Option<f64>,
    /// The greatest difference to either side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equal_within: Option<f64>,
}

/// What came of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    /// Which cell.
    pub cell: usize,
    /// Which seed.
    pub seed: u64,
    /// What came of it.
    pub outcome: RunOutcome,
}

/// What came of one run: figures, or why there are none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "status", deny_unknown_fields)]
#[expect(
    clippy::large_enum_variant,
    reason = "nearly all runs come to their end: a box for each would save nothing"
)]
pub enum RunOutcome {
    /// It came to its end.
    Done {
        /// How it ended: `completed`, `stopped`.
        end: String,
        /// Who stopped it and why.
        end_detail: String,
        /// The run's digest.
        digest: String,
        /// When it ended, in virtual time.
        sim_time_s: f64,
        /// It ended because its time was over: what had not happened might still have, so it is
        /// censored. In a run that ended otherwise it would never have happened.
        timed_out: bool,
        /// Events handled.
        events: u64,
        /// What became of its messages.
        messages: MessageCounts,
        /// What the system reports, arrays and all; only what the study measures.
        metrics: Map<String, Value>,
        /// What must never happen and did.
        violations: Vec<String>,
        /// The entries of the scenario for which the run ended too soon: `degrade.0`, `crash.1`.
        /// None at all in results of older versions.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        never_reached: Vec<String>,
    },
    /// It failed: a panic, a fault, a scenario that cannot be.
    Failed {
        /// Why.
        error: String,
    },
}

/// What became of a run's messages.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MessageCounts {
    /// Sent by actors.
    pub sent: u64,
    /// Copies delivered.
    pub delivered: u64,
    /// Copies lost.
    pub lost: u64,
    /// Copies beyond the first of a message.
    pub duplicated: u64,
    /// Copies on their way when the run ended.
    pub in_flight: u64,
    /// Lost copies by reason.
    pub lost_by_reason: BTreeMap<String, u64>,
}

/// A study's results: what a results folder holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Results {
    /// What was run.
    pub manifest: Manifest,
    /// One record for each run so far, in order of (cell, seed).
    pub runs: Vec<RunRecord>,
}

impl Results {
    /// The runs of one cell, in seed order.
    pub fn of_cell(&self, cell: usize) -> &[RunRecord] {
        let start = self.runs.partition_point(|run| run.cell < cell);
        let end = self.runs.partition_point(|run| run.cell <= cell);
        &self.runs[start..end]
    }
}
