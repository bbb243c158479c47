//! Settings of a system, declared once: one list of keys gives the struct, its defaults, its
//! reading and writing, range checks with the key's own place, and what `farside explain` says of
//! each key. The documentation of the struct's fields has all of it too, after what is written there:
//! default, range, the name in scenarios, and the module that reads the value with its unit.
//!
//! ```
//! use farside::SimDuration;
//! use farside_actors::settings;
//! use farside_actors::system::settings::{Table, over};
//! use farside_actors::units;
//!
//! settings! {
//!     /// The `[ping]` table: who is asked, and how often.
//!     pub struct PingSettings {
//!         /// How many pings are sent.
//!         pub count: u32 = 10, 1..=1000;
//!         /// The time between two of them.
//!         pub interval: SimDuration [with = "units::duration"] = SimDuration::from_secs(1),
//!             over(SimDuration::ZERO);
//!         /// How far the rover is, in metres.
//!         pub distance_m as "distance": f64 [with = "units::length_m"] = 40.0;
//!     }
//! }
//!
//! let settings: PingSettings = toml::from_str("interval = '250ms'\ncount = 0")?;
//! assert_eq!((settings.distance_m, settings.interval.as_secs_f64()), (40.0, 0.25));
//! let error = settings.check("ping").unwrap_err().to_string();
//! assert_eq!(error, "ping.count: 0: expected 1 to 1000");
//! let section = &PingSettings::sections("ping")[0];
//! assert_eq!(section.keys[2].name, "distance");
//! assert_eq!(section.keys[0].expected, "1 to 1000");
//! assert_eq!(section.defaults["interval"].as_str(), Some("1s"));
//! # Ok::<(), toml::de::Error>(())
//! ```

use std::fmt::Display;
use std::ops::{Range, RangeFrom, RangeInclusive};

use serde::Serialize;

use super::{Section, SetupError};

/// A table of a scenario, as [`settings!`](crate::settings) declares it.
pub trait Table: Default + Serialize {
    /// The table called `name` and those within it, each with its keys.
    fn sections(name: &str) -> Vec<Section>;

    /// Checks that every value is in its range.
    ///
    /// # Errors
    /// When one is not; the error names its key, below `name`.
    fn check(&self, name: &str) -> Result<(), SetupError>;
}

/// What the value of a key has to be, beyond its type.
pub trait Rule<T> {
    /// What is expected, as in `1 to 1000`; empty if the type says all.
    fn expected(&self) -> String;

    /// Checks the value of the key called `key`.
    ///
    /// # Errors
    /// When it is not what is expected.
    fn check(&self, key: &str, value: &T) -> Result<(), SetupError>;

    /// The tables below the key called `key`.
    fn sections(&self, _key: &str) -> Vec<Section> {
        Vec::new()
    }
}

/// Refuses a value, or does not.
fn judge(holds: bool, key: &str, value: impl Display, expected: &str) -> Result<(), SetupError> {
    match holds {
        true => Ok(()),
        false => Err(SetupError::value(
            key,
            format!("{value}: expected {expected}"),
        )),
    }
}

impl<T: PartialOrd + Display> Rule<T> for RangeInclusive<T> {
    fn expected(&self) -> String {
        format!("{} to {}", self.start(), self.end())
    }

    fn check(&self, key: &str, value: &T) -> Result<(), SetupError> {
        judge(self.contains(value), key, value, &Rule::<T>::expected(self))
    }
}

impl<T: PartialOrd + Display> Rule<T> for Range<T> {
    fn expected(&self) -> String {
        format!("{} to below {}", self.start, self.end)
    }

    fn check(&self, key: &str, value: &T) -> Result<(), SetupError> {
        judge(self.contains(value), key, value, &Rule::<T>::expected(self))
    }
}

impl<T: PartialOrd + Display> Rule<T> for RangeFrom<T> {
    fn expected(&self) -> String {
        format!("at least {}", self.start)
    }

    fn check(&self, key: &str, value: &T) -> Result<(), SetupError> {
        judge(self.contains(value), key, value, &Rule::<T>::expected(self))
    }
}

/// More than a bound.
#[derive(Clone, Copy, Debug)]
pub struct Over<T>(T);

/// More than `least`.
pub fn over<T>(least: T) -> Over<T> {
    Over(least)
}

impl<T: PartialOrd + Display> Rule<T> for Over<T> {
    fn expected(&self) -> String {
        format!("more than {}", self.0)
    }

    fn check(&self, key: &str, value: &T) -> Result<(), SetupError> {
        judge(*value > self.0, key, value, &self.expected())
    }
}

/// A rule for a value in a unit that its type does not carry.
#[derive(Clone, Copy, Debug)]
pub struct InUnit<R>(&'static str, R);

/// `rule`, for a value in `unit`: `in_unit("m", 0.1..=100.0)`.
pub fn in_unit<R>(unit: &'static str, rule: R) -> InUnit<R> {
    InUnit(unit, rule)
}

impl<T: Display, R: Rule<T>> Rule<T> for InUnit<R> {
    fn expected(&self) -> String {
        format!("{} {}", self.1.expected(), self.0)
    }

    fn check(&self, key: &str, value: &T) -> Result<(), SetupError> {
        let holds = self.1.check(key, value).is_ok();
        let found = format_args!("{value} {}", self.0);
        judge(holds, key, found, &Rule::<T>::expected(self))
    }
}

/// A rule for a value that may be left out.
#[derive(Clone, Copy, Debug)]
pub struct IfSet<R>(R);

/// `rule`, where the key is given at all.
pub fn if_set<R>(rule: R) -> IfSet<R> {
    IfSet(rule)
}

impl<T, R: Rule<T>> Rule<Option<T>> for IfSet<R> {
    fn expected(&self) -> String {
        self.0.expected()
    }

    fn check(&self, key: &str, value: &Option<T>) -> Result<(), SetupError> {
        value
            .as_ref()
            .map_or(Ok(()), |value| self.0.check(key, value))
    }

    fn sections(&self, key: &str) -> Vec<Section> {
        self.0.sections(key)
    }
}

/// A rule that no range says.
#[derive(Clone, Copy, Debug)]
pub struct Where<T> {
    expected: &'static str,
    holds: fn(&T) -> bool,
    shown: fn(&T) -> String,
}

/// What `holds` is true of; `shown` writes a value that it is not.
pub const fn such_that<T>(
    expected: &'static str,
    shown: fn(&T) -> String,
    holds: fn(&T) -> bool,
) -> Where<T> {
    Where {
        expected,
        holds,
        shown,
    }
}

impl<T> Rule<T> for Where<T> {
    fn expected(&self) -> String {
        self.expected.to_owned()
    }

    fn check(&self, key: &str, value: &T) -> Result<(), SetupError> {
        judge((self.holds)(value), key, (self.shown)(value), self.expected)
    }
}

/// Whatever the type allows, which is these words.
#[derive(Clone, Copy, Debug)]
pub struct OneOf(&'static [&'static str]);

/// What a type allows that is read from words: said, not checked.
pub fn one_of(words: &'static [&'static str]) -> OneOf {
    OneOf(words)
}

impl<T> Rule<T> for OneOf {
    fn expected(&self) -> String {
        format!("one of {}", self.0.join(", "))
    }

    fn check(&self, _key: &str, _value: &T) -> Result<(), SetupError> {
        Ok(())
    }
}

/// Whatever the type allows.
#[derive(Clone, Copy, Debug)]
pub struct Any;

impl<T> Rule<T> for Any {
    fn expected(&self) -> String {
        String::new()
    }

    fn check(&self, _key: &str, _value: &T) -> Result<(), SetupError> {
        Ok(())
    }
}

/// A table of its own, or as many as there are: `[network.max_plus]`, `[[traffic.flow]]`.
#[derive(Clone, Copy, Debug)]
pub struct Within;

impl<T: Table> Rule<T> for Within {
    fn expected(&self) -> String {
        "a table".to_owned()
    }

    fn check(&self, key: &str, value: &T) -> Result<(), SetupError> {
        value.check(key)
    }

    fn sections(&self, key: &str) -> Vec<Section> {
        T::sections(key)
    }
}

impl<T: Table> Rule<Vec<T>> for Within {
    fn expected(&self) -> String {
        "tables".to_owned()
    }

    fn check(&self, key: &str, value: &Vec<T>) -> Result<(), SetupError> {
        let mut all = value.iter().enumerate();
        all.try_for_each(|(index, table)| table.check(&format!("{key}.{index}")))
    }

    fn sections(&self, key: &str) -> Vec<Section> {
        T::sections(key)
    }
}

/// The defaults of a table as TOML; empty if they cannot be written.
pub fn defaults<T: Table>() -> toml::Table {
    toml::Table::try_from(T::default()).unwrap_or_default()
}

/// Declares a table of a scenario: see [`settings`](crate::system::settings).
///
/// Of each key: its documentation, its visibility and name, `as "name"` if the scenario calls it
/// otherwise, its type, what serde has to know in brackets, its default after `=` (that of its type
/// unless given), and after a comma the [`Rule`](crate::system::settings::Rule) that its value
/// follows.
#[macro_export]
macro_rules! settings {
    (
        $(#[doc = $about:literal])+
        $vis:vis struct $name:ident {
            $(
                $(#[doc = $doc:literal])+
                $field_vis:vis $field:ident $(as $key:literal)?: $type:ty $([$($serde:tt)+])?
                    $(= $default:expr)? $(, $rule:expr)?;
            )+
        }
    ) => {
        $(#[doc = $about])+
        #[derive(Clone, Debug, PartialEq, ::serde::Serialize, ::serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        $vis struct $name {
            $(
                $(#[doc = $doc])+
                $(#[doc = concat!("\n\nDefault: `", stringify!($default), "`")])?
                $(#[doc = concat!("\n\nExpected: `", stringify!($rule), "`")])?
                $(#[doc = concat!("\n\nIn scenarios: `", stringify!($key), "`")])?
                $(#[doc = concat!("\n\nSerde: `", stringify!($($serde)+), "`")])?
                $(#[serde(rename = $key)])?
                $(#[serde($($serde)+)])?
                $field_vis $field: $type,
            )+
        }

        impl Default for $name {
            fn default() -> Self {
                $name {
                    $($field: $crate::settings!(@default $($default)?),)+
                }
            }
        }

        impl $crate::system::settings::Table for $name {
            fn sections(name: &str) -> Vec<$crate::system::Section> {
                use $crate::system::settings::Rule;
                let mut all = vec![$crate::system::Section {
                    name: name.to_owned(),
                    about: &[$($about),+],
                    keys: vec![$($crate::system::Key {
                        expected: Rule::<$type>::expected(&$crate::settings!(@rule $($rule)?)),
                        ..$crate::system::Key::new(
                            $crate::settings!(@key $field $($key)?),
                            &[$($doc),+],
                        )
                        .typed(stringify!($type), concat!($(stringify!($($serde)+))?))
                    }),+],
                    defaults: $crate::system::settings::defaults::<Self>(),
                }];
                $(all.extend(Rule::<$type>::sections(
                    &$crate::settings!(@rule $($rule)?),
                    &format!("{name}.{}", $crate::settings!(@key $field $($key)?)),
                ));)+
                all
            }

            fn check(&self, name: &str) -> Result<(), $crate::system::SetupError> {
                use $crate::system::settings::Rule;
                $(Rule::<$type>::check(
                    &$crate::settings!(@rule $($rule)?),
                    &format!("{name}.{}", $crate::settings!(@key $field $($key)?)),
                    &self.$field,
                )?;)+
                Ok(())
            }
        }
    };
    (@default $default:expr) => { $default };
    (@default) => { Default::default() };
    (@key $field:ident $key:literal) => { $key };
    (@key $field:ident) => { stringify!($field) };
    (@rule $rule:expr) => { $rule };
    (@rule) => { $crate::system::settings::Any };
}

#[cfg(test)]
mod tests {
    use super::*;

    settings! {
        /// A part.
        struct Part {
            /// Its size.
            size: f64 = 2.0, in_unit("m", 0.5..4.0);
        }
    }

    settings! {
        /// The whole,
        /// in two lines.
        struct Whole {
            /// One part.
            part: Part = Part::default(), Within;
            /// More of them.
            more as "piece": Vec<Part>, Within;
            /// As many as wanted.
            count: Option<u32> [skip_serializing_if = "Option::is_none"], if_set(1..);
            /// Words.
            how: String = "so".to_owned(), one_of(&["so", "thus"]);
        }
    }

    fn refused(text: &str) -> String {
        let whole: Whole = toml::from_str(text).unwrap();
        whole.check("whole").unwrap_err().to_string()
    }

    #[test]
    fn a_value_out_of_its_range_is_blamed_on_its_own_key() {
        let size = "0.5 to below 4 m";
        assert_eq!(
            refused("part.size = 4"),
            format!("whole.part.size: 4 m: expected {size}")
        );
        assert_eq!(
            refused("piece = [{}, { size = nan }]"),
            format!("whole.piece.1.size: NaN m: expected {size}")
        );
        assert_eq!(refused("count = 0"), "whole.count: 0: expected at least 1");
        let fine: Whole = toml::from_str("part.size = 0.5\ncount = 1").unwrap();
        assert!(fine.check("whole").is_ok());
    }

    #[test]
    fn every_key_is_described_with_its_default() {
        let sections = Whole::sections("whole");
        let names: Vec<&str> = sections
            .iter()
            .map(|section| section.name.as_str())
            .collect();
        assert_eq!(names, ["whole", "whole.part", "whole.piece"]);
        assert_eq!(sections[0].about, [" The whole,", " in two lines."]);
        let expected: Vec<&str> = sections[0].keys.iter().map(|key| &*key.expected).collect();
        assert_eq!(
            expected,
            ["a table", "tables", "at least 1", "one of so, thus"]
        );
        assert_eq!(sections[1].defaults["size"].as_float(), Some(2.0));
        assert!(toml::from_str::<Whole>("coutn = 1").is_err());
    }
}
