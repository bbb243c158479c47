//! The text of a study: what its keys are, and how they are read.

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::results::{PlotAxes, Scale};

/// A study file, as it is written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StudyFile {
    pub(super) question: String,
    pub(super) scenario: String,
    #[serde(default)]
    pub(super) set: toml::Table,
    #[serde(default)]
    pub(super) factor: Vec<FactorFile>,
    #[serde(default)]
    pub(super) design: Design,
    #[serde(default)]
    pub(super) cell: Vec<toml::Table>,
    pub(super) cells: Option<u32>,
    pub(super) design_seed: Option<u64>,
    pub(super) seeds: Option<Seeds>,
    pub(super) block: Option<u32>,
    pub(super) metrics: Vec<MetricFile>,
    pub(super) baseline: Option<toml::Table>,
    pub(super) stop: Option<StopFile>,
    #[serde(default)]
    pub(super) published: Vec<PublishedFile>,
    /// The `[report]` table.
    #[serde(default)]
    pub(super) report: PlotAxes,
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

/// A `[[factor]]` table.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FactorFile {
    pub(super) name: String,
    pub(super) label: Option<String>,
    pub(super) unit: Option<String>,
    #[serde(default)]
    pub(super) scale: Scale,
    pub(super) key: Option<String>,
    pub(super) keys: Option<Vec<String>>,
    pub(super) values: Option<Vec<toml::Value>>,
    pub(super) range: Option<[toml::Value; 2]>,
    pub(super) steps: Option<u32>,
    pub(super) variants: Option<Vec<VariantFile>>,
}

/// An entry of a factor's `variants`: a value with a name that sets several keys at once.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VariantFile {
    pub(super) name: String,
    /// What it sets, as in the study's own `set`; nothing for the scenario as it is.
    #[serde(default)]
    pub(super) set: toml::Table,
}

/// The `[stop]` table.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StopFile {
    pub(super) metric: String,
    pub(super) width: f64,
    pub(super) min_seeds: u32,
    pub(super) max_seeds: u32,
}

/// A `[[published]]` table: figures of others, to set ours beside.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PublishedFile {
    pub(super) metric: String,
    pub(super) title: String,
    pub(super) source: String,
    pub(super) unit: Option<String>,
    pub(super) scale: Option<f64>,
    pub(super) rows: Option<String>,
    /// Each says where it holds and what is claimed there; its keys are the factors and those of a
    /// claim, so it is read by hand.
    pub(super) values: Vec<toml::Table>,
    pub(super) note: Option<String>,
    pub(super) why: Option<String>,
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

/// What a study says of a curve's index, instead of what its system says.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct IndexFile {
    pub(super) label: Option<String>,
    pub(super) unit: Option<String>,
    pub(super) lengths_differ: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MetricTable {
    name: String,
    label: Option<String>,
    unit: Option<String>,
    index: Option<IndexFile>,
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
