//! Durations of scenarios that may be `"auto"`: for serde's `with`.

use farside::SimDuration;
use farside_actors::units::parse_duration;
use serde::de::{Error, Visitor};
use serde::{Deserializer, Serializer};

pub(crate) fn serialize<S: Serializer>(
    duration: &Option<SimDuration>,
    to: S,
) -> Result<S::Ok, S::Error> {
    match duration {
        Some(duration) => to.collect_str(duration),
        None => to.serialize_str("auto"),
    }
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<SimDuration>, D::Error> {
    from.deserialize_any(AutoOr)
}

struct AutoOr;

impl Visitor<'_> for AutoOr {
    type Value = Option<SimDuration>;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a duration such as \"250ms\", or \"auto\"")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        if text.trim() == "auto" {
            return Ok(None);
        }
        parse_duration(text).map(Some).map_err(E::custom)
    }
}
