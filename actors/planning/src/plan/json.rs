//! Plans to and from JSON: the format's name, limits, errors, and what is written otherwise than
//! the fields are.

use std::collections::BTreeSet;
use std::fmt;

use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use super::{Moment, Origin, Plan, PlanValue, TokenId};
use crate::Ticks;
use crate::nearest::did_you_mean;
use crate::temporal::FURTHEST;

/// The format that is written, and its version.
pub const FORMAT: &str = "farside-plan/1.0";

/// The most bytes of a plan that are read.
pub const MAX_FILE_BYTES: usize = 64 << 20;

/// Why a text is no plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// The file is too large.
    #[error("the file has {actual_bytes} bytes; at most {MAX_FILE_BYTES} are read")]
    TooLarge {
        /// How many bytes it has.
        actual_bytes: usize,
    },
    /// The text is no JSON, or not what a plan consists of.
    #[error("line {line}, column {column}: {problem}")]
    Text {
        /// The line, from 1.
        line: usize,
        /// The character within the line; 0 at a line's end.
        column: usize,
        /// What is wrong.
        problem: String,
    },
    /// A field does not fit the others.
    #[error("{path}: {problem}")]
    Field {
        /// Where it is, as `tokens[3].id`.
        path: String,
        /// What is wrong.
        problem: String,
    },
}

impl Plan {
    /// Reads a plan. What it says may still be wrong: ask the [checker](crate::checker).
    ///
    /// # Errors
    ///
    /// If the file is too large, is no JSON, has fields that plans do not have, or tokens that
    /// cannot be told apart or are not there.
    pub fn from_json(bytes: &[u8]) -> Result<Plan, PlanError> {
        if bytes.len() > MAX_FILE_BYTES {
            return Err(PlanError::TooLarge {
                actual_bytes: bytes.len(),
            });
        }
        let plan: Plan = serde_json::from_slice(bytes).map_err(|error| PlanError::Text {
            line: error.line(),
            column: error.column(),
            problem: with_nearest(&error),
        })?;
        plan.is_well_formed()?;
        Ok(plan)
    }

    /// The plan as JSON, with a line's end at its end. Equal plans give equal texts.
    ///
    /// # Panics
    ///
    /// Never: nothing in a plan cannot be written.
    pub fn to_json(&self) -> String {
        let text = serde_json::to_string_pretty(self);
        text.expect("a plan has no maps but those with names as keys") + "\n"
    }

    /// That numbers of tokens name one each, and times can be reckoned with.
    fn is_well_formed(&self) -> Result<(), PlanError> {
        let reckoned = |time: Ticks| (-FURTHEST..=FURTHEST).contains(&time);
        if !(0..=FURTHEST).contains(&self.horizon) {
            return Err(field("horizon", format!("{} is no horizon", self.horizon)));
        }
        let mut ids = BTreeSet::new();
        for (place, token) in self.tokens.iter().enumerate() {
            let path = |name: &str| format!("tokens[{place}].{name}");
            if !ids.insert(token.id) {
                let problem = format!("another token has the number {} as well", token.id);
                return Err(field(path("id"), problem));
            }
            let ([a, b], [c, d]) = (token.start_window, token.end_window);
            let times = [token.start, token.end, a, b, c, d];
            let names = ["start", "end", "start_window", "start_window", "end_window"];
            let wrong = times.iter().position(|&time| !reckoned(time));
            if let Some(wrong) = wrong {
                let name = names.get(wrong).copied().unwrap_or("end_window");
                let problem = format!("{} is no time: at most {FURTHEST} is", times[wrong]);
                return Err(field(path(name), problem));
            }
        }
        let known = |id: TokenId, path: String| match ids.contains(&id) {
            true => Ok(()),
            false => Err(field(path, format!("there is no token {id}"))),
        };
        for (place, token) in self.tokens.iter().enumerate() {
            if let Origin::Rule { master, .. } = token.origin {
                known(master, format!("tokens[{place}].origin.rule.master"))?;
            }
        }
        for (place, achieved) in self.achieved.iter().enumerate() {
            known(achieved.token, format!("achieved[{place}].token"))?;
        }
        for (place, constraint) in self.constraints.iter().enumerate() {
            let ends: [(_, Option<Moment>); 2] = [("from", constraint.from), ("to", constraint.to)];
            for (name, moment) in ends {
                if let Some(moment) = moment {
                    known(moment.token, format!("constraints[{place}].{name}.token"))?;
                }
            }
            for (name, bound) in [("min", constraint.min), ("max", constraint.max)] {
                if let Some(bound) = bound.filter(|&bound| !reckoned(bound)) {
                    let problem = format!("{bound} is no bound: at most {FURTHEST} is");
                    return Err(field(format!("constraints[{place}].{name}"), problem));
                }
            }
        }
        Ok(())
    }
}

fn field(path: impl Into<String>, problem: String) -> PlanError {
    PlanError::Field {
        path: path.into(),
        problem,
    }
}

/// What the reader says, without the place that is told apart from it, and with the nearest of the
/// names that it expected.
fn with_nearest(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let text = match text.rfind(" at line ") {
        Some(end) => &text[..end],
        None => &text,
    };
    if !text.starts_with("unknown ") {
        return text.to_string();
    }
    let mut names = text.split('`').skip(1).step_by(2);
    let found = names.next().unwrap_or_default();
    format!("{text}{}", did_you_mean(found, names))
}

/// The format's name, which says itself and accepts nothing else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Format;

impl Serialize for Format {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(FORMAT)
    }
}

impl<'de> Deserialize<'de> for Format {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;
        impl Visitor<'_> for Name {
            type Value = Format;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "the format {FORMAT:?}")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<Format, E> {
                match name == FORMAT {
                    true => Ok(Format),
                    false => Err(E::invalid_value(de::Unexpected::Str(name), &self)),
                }
            }
        }
        deserializer.deserialize_str(Name)
    }
}

impl Serialize for PlanValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            PlanValue::Unbound => serializer.serialize_unit(),
            PlanValue::Truth(truth) => serializer.serialize_bool(*truth),
            PlanValue::Number(number) => serializer.serialize_i64(*number),
            PlanValue::Symbol(name) => serializer.serialize_str(name),
        }
    }
}

impl<'de> Deserialize<'de> for PlanValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AnyValue;
        impl Visitor<'_> for AnyValue {
            type Value = PlanValue;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a whole number, true, false, the name of a symbol, or null")
            }

            fn visit_unit<E: de::Error>(self) -> Result<PlanValue, E> {
                Ok(PlanValue::Unbound)
            }

            fn visit_bool<E: de::Error>(self, truth: bool) -> Result<PlanValue, E> {
                Ok(PlanValue::Truth(truth))
            }

            fn visit_i64<E: de::Error>(self, number: i64) -> Result<PlanValue, E> {
                Ok(PlanValue::Number(number))
            }

            fn visit_u64<E: de::Error>(self, number: u64) -> Result<PlanValue, E> {
                let unexpected = de::Unexpected::Unsigned(number);
                let number = i64::try_from(number).ok().map(PlanValue::Number);
                number.ok_or_else(|| E::invalid_value(unexpected, &self))
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<PlanValue, E> {
                Ok(PlanValue::Symbol(name.to_owned()))
            }
        }
        deserializer.deserialize_any(AnyValue)
    }
}

/// Arguments as a JSON object, in their order.
pub(super) mod arguments {
    use super::*;
    use serde::de::MapAccess;
    use serde::ser::SerializeMap;

    type Arguments = Vec<(String, PlanValue)>;

    // Serde's attribute asks for this signature.
    pub(crate) fn serialize<S: Serializer>(
        arguments: &Arguments,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(arguments.len()))?;
        for (name, value) in arguments {
            map.serialize_entry(name, value)?;
        }
        map.end()
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Arguments, D::Error> {
        struct Named;
        impl<'de> Visitor<'de> for Named {
            type Value = Arguments;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object of arguments by name")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Arguments, A::Error> {
                let mut arguments = Arguments::new();
                let mut names = BTreeSet::new();
                while let Some((name, value)) = map.next_entry::<String, PlanValue>()? {
                    if !names.insert(name.clone()) {
                        let twice = format!("the argument `{name}` stands here twice");
                        return Err(de::Error::custom(twice));
                    }
                    arguments.push((name, value));
                }
                Ok(arguments)
            }
        }
        deserializer.deserialize_map(Named)
    }
}
