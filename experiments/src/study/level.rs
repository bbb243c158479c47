//! Levels: the values that a factor takes, as numbers in base units and as people write them.

use farside::SimDuration;
use farside_actors::units;
use serde_json::Value;

use super::results::Scale;

/// What a number measures, which says its base unit and how it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dimension {
    /// No number at all.
    Text,
    /// A number as TOML has it.
    Number,
    /// A fraction, written in percent.
    Percent,
    Duration,
    Length,
    DataRate,
    DataSize,
}

impl Dimension {
    /// The unit in which the values are, if the dimension says.
    pub(super) fn unit(self) -> Option<&'static str> {
        match self {
            Dimension::Text | Dimension::Number => None,
            Dimension::Percent => Some(""),
            Dimension::Duration => Some("s"),
            Dimension::Length => Some("m"),
            Dimension::DataRate => Some("bit/s"),
            Dimension::DataSize => Some("B"),
        }
    }

    /// Whether values of both can stand on one axis.
    pub(super) fn fits(self, other: Dimension) -> bool {
        let same = |d| match d {
            Dimension::Percent => Dimension::Number,
            d => d,
        };
        same(self) == same(other)
    }
}

/// One value of a factor.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Level {
    /// As the scenario is given it.
    pub(super) toml: toml::Value,
    /// A number in base units, or a text.
    pub(super) value: Value,
    /// As people write it.
    pub(super) text: String,
    pub(super) dimension: Dimension,
    /// The arguments of `--set` of a variant; a value that is none gives itself to the factor's
    /// keys.
    variant: Option<Vec<String>>,
}

impl Level {
    /// A value as it stands in a study.
    pub(super) fn new(toml: &toml::Value) -> Self {
        let text = match toml {
            toml::Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let (value, dimension) = match toml {
            toml::Value::Integer(number) => (Value::from(*number), Dimension::Number),
            toml::Value::Float(number) if number.is_finite() => {
                (Value::from(*number), Dimension::Number)
            }
            toml::Value::String(text) => match quantity(text) {
                Some((number, dimension)) => (Value::from(number), dimension),
                None => (Value::from(text.as_str()), Dimension::Text),
            },
            _ => (Value::from(text.as_str()), Dimension::Text),
        };
        Level {
            toml: toml.clone(),
            value,
            text,
            dimension,
            variant: None,
        }
    }

    /// A value that is a name for what it sets.
    pub(super) fn variant(name: &str, sets: Vec<String>) -> Self {
        Level {
            variant: Some(sets),
            ..Self::new(&toml::Value::String(name.to_owned()))
        }
    }

    /// The same as a word, even if it could be read as a quantity.
    pub(super) fn into_word(self) -> Self {
        Level {
            value: Value::from(self.text.as_str()),
            dimension: Dimension::Text,
            ..self
        }
    }

    /// A value as it stands on the command line: TOML, or else a string.
    pub(super) fn of_argument(text: &str) -> Self {
        let text = text.trim();
        let table = format!("v = {text}").parse::<toml::Table>();
        let value = table.ok().and_then(|mut table| table.remove("v"));
        Self::new(&value.unwrap_or_else(|| toml::Value::String(text.to_owned())))
    }

    /// The number, if it is one.
    pub(super) fn number(&self) -> Option<f64> {
        self.value.as_f64()
    }

    /// Whether both are the same value, however written.
    pub(super) fn is(&self, value: &Value, text: &str) -> bool {
        match (self.number(), value.as_f64()) {
            (Some(a), Some(b)) => a == b,
            _ => self.value == *value || self.text == text,
        }
    }

    /// The argument of `--set` that gives `key` this value.
    pub(super) fn set(&self, key: &str) -> String {
        set_argument(key, &self.toml)
    }

    /// The arguments of `--set` that a factor with these keys makes of it.
    pub(super) fn sets(&self, keys: &[String]) -> Vec<String> {
        match &self.variant {
            Some(sets) => sets.clone(),
            None => keys.iter().map(|key| self.set(key)).collect(),
        }
    }
}

/// One value of a `set` table.
pub(super) struct Setting {
    /// The scenario's key, dotted.
    pub(super) key: String,
    /// The argument of `--set`.
    pub(super) argument: String,
    /// The keys in the study that lead to it.
    pub(super) path: Vec<String>,
}

/// All values of a `set` table that stands at `path`, dotted, in the study.
pub(super) fn settings(table: &toml::Table, path: &str) -> Vec<Setting> {
    let mut settings = Vec::new();
    let mut path: Vec<String> = path.split('.').map(str::to_owned).collect();
    for (key, value) in table {
        path.push(key.clone());
        // In quotes, a dotted key is what it is as an argument.
        flatten(key, value, &mut path, &mut settings);
        path.pop();
    }
    settings
}

fn flatten(key: &str, value: &toml::Value, path: &mut Vec<String>, settings: &mut Vec<Setting>) {
    let toml::Value::Table(table) = value else {
        settings.push(Setting {
            key: key.to_owned(),
            argument: set_argument(key, value),
            path: path.clone(),
        });
        return;
    };
    for (inner, value) in table {
        let special = inner.contains(['.', '=', '\'']) || inner.trim() != inner || inner.is_empty();
        let part = if special {
            format!("\"{inner}\"")
        } else {
            inner.clone()
        };
        path.push(inner.clone());
        flatten(&format!("{key}.{part}"), value, path, settings);
        path.pop();
    }
}

/// The argument of `--set` that gives `key` this value.
pub(super) fn set_argument(key: &str, value: &toml::Value) -> String {
    let toml::Value::String(text) = value else {
        return format!("{key}={value}");
    };
    // A text that would be read as something else needs its quotes.
    let reads_as_toml = format!("v = {text}").parse::<toml::Table>().is_ok();
    let opens = text.starts_with(['[', '{', '"', '\'']);
    if reads_as_toml || opens || text.trim() != text || text.is_empty() || text.contains('\n') {
        format!("{key}={value}")
    } else {
        format!("{key}={text}")
    }
}

/// The number in base units that the text is, if it is a quantity.
fn quantity(text: &str) -> Option<(f64, Dimension)> {
    if let Ok(duration) = units::parse_duration(text) {
        // One rounding: 600 ms are 0.6 s, as people write it.
        let seconds = duration.as_nanos() as f64 / 1e9;
        return Some((seconds, Dimension::Duration));
    }
    if let Ok(fraction) = units::parse_fraction(text) {
        return Some((fraction, Dimension::Percent));
    }
    if let Ok(length_m) = units::parse_length_m(text) {
        return Some((length_m, Dimension::Length));
    }
    if let Ok(rate) = units::parse_data_rate(text) {
        return Some((rate as f64, Dimension::DataRate));
    }
    let size = units::parse_data_size(text).ok()?;
    Some((size as f64, Dimension::DataSize))
}

/// A range of numbers of one dimension.
#[derive(Clone, Debug)]
pub(super) struct Range {
    low: Level,
    high: Level,
    scale: Scale,
    whole: bool,
}

impl Range {
    /// The range between two values.
    pub(super) fn new(low: &toml::Value, high: &toml::Value, scale: Scale) -> Result<Self, String> {
        let whole = low.is_integer() && high.is_integer();
        let (low, high) = (Level::new(low), Level::new(high));
        let (Some(from), Some(to)) = (low.number(), high.number()) else {
            return Err(format!(
                "{} to {}: expected two numbers or quantities",
                low.text, high.text
            ));
        };
        if !low.dimension.fits(high.dimension) {
            return Err(format!(
                "{} to {}: expected two quantities of the same sort",
                low.text, high.text
            ));
        }
        if from >= to {
            return Err(format!(
                "{} to {}: expected the lower end first",
                low.text, high.text
            ));
        }
        if scale == Scale::Log && from <= 0.0 {
            return Err(format!(
                "{}: expected more than zero on a log scale",
                low.text
            ));
        }
        Ok(Range {
            low,
            high,
            scale,
            whole,
        })
    }

    pub(super) fn dimension(&self) -> Dimension {
        self.low.dimension
    }

    /// The value at `share` of the way, from 0 to 1: evenly, or by ratio on a log scale.
    fn number_at(&self, share: f64) -> f64 {
        let ends = (self.low.number(), self.high.number());
        let (low, high) = (ends.0.unwrap_or(0.0), ends.1.unwrap_or(0.0));
        match self.scale {
            Scale::Linear => low + (high - low) * share,
            Scale::Log => {
                let (low, high) = (libm::log(low), libm::log(high));
                libm::exp(low + (high - low) * share)
            }
        }
    }

    /// `steps` values from one end to the other.
    pub(super) fn steps(&self, steps: u32) -> Vec<Level> {
        let last = steps.saturating_sub(1).max(1);
        let inner = (1..last).map(|step| {
            let share = f64::from(step) / f64::from(last);
            self.level(rounded(self.number_at(share)))
        });
        let mut levels = vec![self.low.clone()];
        levels.extend(inner);
        if steps > 1 {
            levels.push(self.high.clone());
        }
        levels
    }

    /// The value at `share` of the way through the `part`th of `parts` equal parts.
    pub(super) fn in_part(&self, part: u32, parts: u32, share: f64) -> Level {
        let (part, parts) = (f64::from(part), f64::from(parts));
        if self.whole && self.scale == Scale::Linear {
            // As many whole numbers as possible have equal shares of the range.
            let low = self.low.number().unwrap_or(0.0);
            let count = self.high.number().unwrap_or(0.0) - low + 1.0;
            return self.level(low + (count * (part + share) / parts).floor());
        }
        let exact = self.number_at((part + share) / parts);
        let (from, to) = (
            self.number_at(part / parts),
            self.number_at((part + 1.0) / parts),
        );
        // Few digits are for people; they must not leave the part.
        let short = rounded(exact);
        self.level(if from <= short && short < to {
            short
        } else {
            exact
        })
    }

    /// A number of this dimension as it stands in a scenario.
    fn level(&self, number: f64) -> Level {
        let toml = match self.dimension() {
            Dimension::Duration => {
                let nanos = (number * 1e9).round() as u64;
                let text = units::print_duration(SimDuration::from_nanos(nanos));
                toml::Value::String(text)
            }
            Dimension::Length => toml::Value::String(units::print_length_m(number)),
            Dimension::DataRate => {
                toml::Value::String(units::print_data_rate(number.round() as u64))
            }
            Dimension::DataSize => {
                toml::Value::String(units::print_data_size(number.round() as u64))
            }
            Dimension::Number if self.whole => toml::Value::Integer(number.round() as i64),
            Dimension::Percent => {
                toml::Value::String(format!("{}%", rounded_to(number * 100.0, 12)))
            }
            Dimension::Number | Dimension::Text => toml::Value::Float(number),
        };
        Level::new(&toml)
    }
}

/// The number with six digits, as people would write it.
fn rounded(number: f64) -> f64 {
    rounded_to(number, 6)
}

fn rounded_to(number: f64, digits: usize) -> f64 {
    // Through text the rounding is the same everywhere, and 0.15 is no 0.15000000000000002.
    let text = format!("{number:.*e}", digits - 1);
    text.parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn string(text: &str) -> toml::Value {
        toml::Value::String(text.to_owned())
    }

    #[test]
    fn values_are_in_base_units_and_keep_their_text() {
        let level = Level::new(&string("600ms"));
        assert_eq!((level.number(), level.text.as_str()), (Some(0.6), "600ms"));
        assert_eq!(
            level.set("links.default.latency"),
            "links.default.latency=600ms"
        );
        let unit = |text: &str| Level::new(&string(text)).dimension.unit();
        let units = ["30%", "40m", "128kbit/s", "64kB", "3min", "paper"].map(unit);
        assert_eq!(
            units,
            [
                Some(""),
                Some("m"),
                Some("bit/s"),
                Some("B"),
                Some("s"),
                None
            ]
        );
        assert_eq!(Level::new(&toml::Value::Float(0.3)).set("a"), "a=0.3");
        assert_eq!(Level::new(&toml::Value::Float(1.0)).set("a"), "a=1.0");
        // What would be read as a number, and is a text.
        assert_eq!(Level::new(&string("5")).set("a"), "a=\"5\"");
        assert!(Level::of_argument("0.6s").is(&level.value, &level.text));
    }

    #[test]
    fn tables_are_written_on_one_line() {
        let table: toml::Table = "v = [{ at = '1s', links = '*' }]".parse().unwrap();
        let argument = set_argument("degrade", &table["v"]);
        let (_, value) = argument.split_once('=').unwrap();
        let again: toml::Table = format!("v = {value}").parse().unwrap();
        assert_eq!(again, table);
        assert!(!argument.contains('\n'));
    }

    #[test]
    fn ranges_are_walked_evenly_or_by_ratio() {
        let texts = |range: Range, steps| -> Vec<String> {
            range.steps(steps).into_iter().map(|l| l.text).collect()
        };
        let float = toml::Value::Float;
        let loss = Range::new(&float(0.0), &float(0.75), Scale::Linear).unwrap();
        assert_eq!(
            texts(loss, 6),
            ["0.0", "0.15", "0.3", "0.45", "0.6", "0.75"]
        );
        let percent = Range::new(&string("0%"), &string("30%"), Scale::Linear).unwrap();
        assert_eq!(texts(percent, 4), ["0%", "10%", "20%", "30%"]);
        let delay = Range::new(&string("1ms"), &string("1s"), Scale::Log).unwrap();
        assert_eq!(texts(delay, 4), ["1ms", "10ms", "100ms", "1s"]);
        let whole = toml::Value::Integer;
        let rovers = Range::new(&whole(5), &whole(10), Scale::Linear).unwrap();
        assert_eq!(texts(rovers, 3), ["5", "8", "10"]);
        for (low, high) in [("5s", "5m"), ("5s", "5s"), ("a", "b")] {
            assert!(Range::new(&string(low), &string(high), Scale::Linear).is_err());
        }
        assert!(Range::new(&string("0s"), &string("1s"), Scale::Log).is_err());
    }
}
