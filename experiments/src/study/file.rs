//! The text of a study: what its keys are, and how they are read.

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use farside_actors::documented;
use farside_actors::system::Section;

use super::results::{PlotAxes, Scale};

documented! {
    /// A study file, as it is written.
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct StudyFile {
        /// The one question that the study answers; the report's title.
        pub(super) question: String,
        /// The scenario that it is put to: a built-in one's name, or a file, relative to this one.
        pub(super) scenario: String,
        /// Keys of the scenario that all cells have, as the scenario writes them.
        #[serde(default)]
        pub(super) set: toml::Table,
        /// What is varied: a `[[factor]]` table each.
        #[serde(default)]
        pub(super) factor: Vec<FactorFile>,
        /// How cells are made of factors: grid (all combinations), paired (the factors advance
        /// together), list (`[[cell]]` tables give the values) or latin-hypercube (`cells` points
        /// spread over ranges); a grid unless given.
        #[serde(default)]
        pub(super) design: Design,
        /// With the design list: a cell each, which gives each factor's value by the factor's name.
        #[serde(default)]
        pub(super) cell: Vec<toml::Table>,
        /// With the design latin-hypercube: how many cells.
        pub(super) cells: Option<u32>,
        /// With the design latin-hypercube: which of its points are taken; 1 unless given.
        pub(super) design_seed: Option<u64>,
        /// How many seeds each cell runs with (1, 2, and so on), or a list of them.
        pub(super) seeds: Option<Seeds>,
        /// How many seeds in turn share a problem: world, team and goals; 1 unless given.
        pub(super) block: Option<u32>,
        /// The metrics that are reported, by name; or tables of name, label, unit and, for curves,
        /// index.
        pub(super) metrics: Vec<MetricFile>,
        /// The cell that others are compared with, by the factors' values; the first unless given.
        pub(super) baseline: Option<toml::Table>,
        /// Run until a metric is known well enough: a `[stop]` table.
        pub(super) stop: Option<StopFile>,
        /// Figures of others beside ours: a `[[published]]` table each.
        #[serde(default)]
        pub(super) published: Vec<PublishedFile>,
        /// Which factors plots put where: a `[report]` table.
        #[serde(default)]
        pub(super) report: PlotAxes,
    }
}

/// What there is to know of each key of a study file, table by table.
pub(crate) fn sections() -> Vec<Section> {
    let section = |name: &str, about: &'static [&'static str], keys| Section {
        name: name.to_owned(),
        about,
        keys,
        defaults: toml::Table::new(),
    };
    vec![
        section("study", &["A study file, at its top."], StudyFile::keys()),
        section(
            "study.factor",
            &["A [[factor]] table of a study: what is varied, and its values or variants."],
            FactorFile::keys(),
        ),
        section(
            "study.factor.variants",
            &["An entry of a factor's variants: a value with a name that sets several keys."],
            VariantFile::keys(),
        ),
        section(
            "study.metrics",
            &["An entry of a study's metrics that says more than a name."],
            MetricTable::keys(),
        ),
        section(
            "study.metrics.index",
            &["What a study says of a curve's index, instead of what its system says."],
            IndexFile::keys(),
        ),
        section(
            "study.stop",
            &["The [stop] table of a study: a cell runs until a metric is known well enough."],
            StopFile::keys(),
        ),
        section(
            "study.published",
            &["A [[published]] table of a study: figures of others, to set ours beside."],
            PublishedFile::keys(),
        ),
        section(
            "study.report",
            &["The [report] table of a study: which factors plots put where."],
            PlotAxes::keys(),
        ),
    ]
}

/// How cells are made of factors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Design {
    /// All combinations of all values; the last factor turns fastest.
    #[default]
    Grid,
    /// The cells that `[[cell]]` tables give.
    List,
    /// `cells` points, spread so that each of `cells` equal parts of each range has one.
    LatinHypercube,
    /// All factors advance together: the first values are a cell, the second ones the next.
    Paired,
}

documented! {
    /// A `[[factor]]` table.
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct FactorFile {
        /// What the factor is called: in cells, in the results' columns, in the baseline.
        pub(super) name: String,
        /// What plots and tables call it; its name unless given.
        pub(super) label: Option<String>,
        /// The unit of bare numbers among its values.
        pub(super) unit: Option<String>,
        /// How its values are spaced in plots, and how a range is divided: linear, or log (by
        /// ratio; all values are above 0). Unless given, a range is divided evenly, and plots space
        /// values by ratio that are all above 0 and span two decades or more.
        pub(super) scale: Option<Scale>,
        /// The key of the scenario that it sets.
        pub(super) key: Option<String>,
        /// The keys of the scenario that it sets, all to the same value.
        pub(super) keys: Option<Vec<String>>,
        /// Its values, as the scenario writes them.
        pub(super) values: Option<Vec<toml::Value>>,
        /// Instead of values: the least and the greatest, with steps or a latin hypercube.
        pub(super) range: Option<[toml::Value; 2]>,
        /// How many values a range gives, both ends among them; 2 to 1000.
        pub(super) steps: Option<u32>,
        /// Instead of a key and values: names for what each sets, several keys or none.
        pub(super) variants: Option<Vec<VariantFile>>,
    }
}

documented! {
    /// An entry of a factor's `variants`: a value with a name that sets several keys at once.
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct VariantFile {
        /// What the value is called.
        pub(super) name: String,
        /// What it sets, as in the study's own `set`; nothing for the scenario as it is.
        #[serde(default)]
        pub(super) set: toml::Table,
    }
}

documented! {
    /// The `[stop]` table.
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct StopFile {
        /// Which metric is to be known.
        pub(super) metric: String,
        /// How narrow its 95 % interval is to be, in the metric's unit.
        pub(super) width: f64,
        /// How many seeds each cell runs at least.
        pub(super) min_seeds: u32,
        /// How many seeds each cell runs at most.
        pub(super) max_seeds: u32,
    }
}

documented! {
    /// A `[[published]]` table: figures of others, to set ours beside.
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct PublishedFile {
        /// The metric that they are of.
        pub(super) metric: String,
        /// The table's or figure's title.
        pub(super) title: String,
        /// Who published them, and where.
        pub(super) source: String,
        /// Their unit; none unless given.
        pub(super) unit: Option<String>,
        /// A published figure is ours times this; 1 unless given.
        pub(super) scale: Option<f64>,
        /// Which factor makes the rows of the table; the first unless given.
        pub(super) rows: Option<String>,
        /// Where each holds, by the factors' values, and what is claimed there: one of value,
        /// about, below, above, linear and exceeds.
        // Their keys are the factors and those of a claim, so they are read by hand.
        pub(super) values: Vec<toml::Table>,
        /// How to read them.
        pub(super) note: Option<String>,
        /// Why ours differ.
        pub(super) why: Option<String>,
    }
}

/// How many seeds, or which.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Seeds {
    /// 1, 2, and so on.
    Count(u64),
    /// These.
    List(Vec<u64>),
}

impl<'de> Deserialize<'de> for Seeds {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct CountOrList;

        impl<'de> Visitor<'de> for CountOrList {
            type Value = Seeds;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("how many seeds, or a list of them")
            }

            fn visit_u64<E: Error>(self, count: u64) -> Result<Seeds, E> {
                Ok(Seeds::Count(count))
            }

            fn visit_i64<E: Error>(self, count: i64) -> Result<Seeds, E> {
                let unexpected = serde::de::Unexpected::Signed(count);
                let count = u64::try_from(count);
                count
                    .map(Seeds::Count)
                    .map_err(|_| E::invalid_value(unexpected, &self))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Seeds, A::Error> {
                let mut seeds = Vec::new();
                while let Some(seed) = list.next_element()? {
                    seeds.push(seed);
                }
                Ok(Seeds::List(seeds))
            }
        }

        from.deserialize_any(CountOrList)
    }
}

/// An entry of `metrics`: a name, or a table that says more.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct MetricFile {
    pub(super) name: String,
    pub(super) label: Option<String>,
    pub(super) unit: Option<String>,
    pub(super) index: Option<IndexFile>,
}

documented! {
    /// What a study says of a curve's index, instead of what its system says.
    #[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct IndexFile {
        /// What the index is: `step`, `time`.
        pub(super) label: Option<String>,
        /// Its unit.
        pub(super) unit: Option<String>,
        /// Whether some runs of a cell may end earlier than others.
        pub(super) lengths_differ: Option<bool>,
    }
}

documented! {
    /// A metric that says more than its name.
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct MetricTable {
        /// Its name.
        name: String,
        /// What plots and tables call it, instead of what its system says.
        label: Option<String>,
        /// Its unit, instead of what its system says.
        unit: Option<String>,
        /// What a curve goes along, instead of what its system says.
        index: Option<IndexFile>,
    }
}

impl<'de> Deserialize<'de> for MetricFile {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct NameOrTable;

        impl<'de> Visitor<'de> for NameOrTable {
            type Value = MetricFile;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a metric's name, or a table of name, label, unit and index")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<MetricFile, E> {
                Ok(MetricFile {
                    name: name.to_owned(),
                    label: None,
                    unit: None,
                    index: None,
                })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<MetricFile, A::Error> {
                let table = MetricTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(MetricFile {
                    name: table.name,
                    label: table.label,
                    unit: table.unit,
                    index: table.index,
                })
            }
        }

        from.deserialize_any(NameOrTable)
    }
}
