//! Units and how numbers with them are read. What each quantity is called is next door.

use farside_worlds::decimal::{Decimal, NumberError};

use super::UnitError;

/// A unit: its symbol, and its size in base units as `factor * 10^exponent`.
pub(super) struct Unit {
    pub(super) symbol: &'static str,
    factor: u64,
    exponent: i32,
}

const fn unit(symbol: &'static str, factor: u64, exponent: i32) -> Unit {
    Unit {
        symbol,
        factor,
        exponent,
    }
}

impl Unit {
    /// Larger than `other`. Durations only, whose exponents are small.
    fn exceeds(&self, other: &Unit) -> bool {
        let size = |unit: &Unit| {
            let power = 10u128.pow(unit.exponent.unsigned_abs());
            u128::from(unit.factor) * power
        };
        size(self) > size(other)
    }
}

/// A quantity: how to ask for it, and its units.
pub(super) struct Quantity {
    pub(super) expected: &'static str,
    pub(super) units: &'static [Unit],
}

pub(super) const DURATION: Quantity = Quantity {
    expected: "a duration such as \"250ms\" or \"3h8min\"",
    units: &[
        unit("ns", 1, 0),
        unit("us", 1, 3),
        unit("µs", 1, 3),
        unit("ms", 1, 6),
        unit("s", 1, 9),
        unit("min", 60, 9),
        unit("h", 3_600, 9),
        unit("d", 86_400, 9),
        unit("sol", 88_775_244, 6),
    ],
};

pub(super) const LENGTH: Quantity = Quantity {
    expected: "a length such as \"40m\" or \"1.5km\"",
    units: &[
        unit("mm", 1, -3),
        unit("cm", 1, -2),
        unit("m", 1, 0),
        unit("km", 1, 3),
    ],
};

pub(super) const SPEED: Quantity = Quantity {
    expected: "a speed such as \"4m/s\" or \"20cm/s\"",
    units: &[
        unit("mm/s", 1, -3),
        unit("cm/s", 1, -2),
        unit("m/s", 1, 0),
        unit("km/s", 1, 3),
    ],
};

pub(super) const ACCELERATION: Quantity = Quantity {
    expected: "an acceleration such as \"1m/s2\" or \"20cm/s2\"",
    units: &[
        unit("mm/s2", 1, -3),
        unit("cm/s2", 1, -2),
        unit("m/s2", 1, 0),
    ],
};

pub(super) const ANGLE: Quantity = Quantity {
    expected: "an angle such as \"30deg\" or \"0.5rad\"",
    units: &[unit("deg", 1, 0), unit("rad", 1, 0)],
};

pub(super) const FRACTION: Quantity = Quantity {
    expected: "a fraction such as 0.3 or \"30%\"",
    units: &[unit("", 1, 0), unit("%", 1, -2)],
};

pub(super) const DATA_RATE: Quantity = Quantity {
    expected: "a data rate such as \"128kbit/s\" or \"2Mbit/s\"",
    units: &[
        unit("bit/s", 1, 0),
        unit("kbit/s", 1, 3),
        unit("Mbit/s", 1, 6),
        unit("Gbit/s", 1, 9),
        unit("B/s", 8, 0),
        unit("kB/s", 8, 3),
        unit("MB/s", 8, 6),
    ],
};

/// Units of data, by the size of a bit (a decimal number) and of a byte.
macro_rules! data_units {
    ($bit:literal e $exponent:literal, $byte:literal) => {
        &[
            unit("B", $byte, 0),
            unit("kB", $byte, 3),
            unit("MB", $byte, 6),
            unit("GB", $byte, 9),
            unit("KiB", $byte << 10, 0),
            unit("MiB", $byte << 20, 0),
            unit("GiB", $byte << 30, 0),
            unit("bit", $bit, $exponent),
            unit("kbit", $bit, $exponent + 3),
            unit("Mbit", $bit, $exponent + 6),
            unit("Gbit", $bit, $exponent + 9),
        ]
    };
}

/// In bytes: a bit is 0.125 of them.
pub(super) const DATA_BYTES: Quantity = Quantity {
    expected: "a data size such as \"1500B\" or \"64kB\"",
    units: data_units!(125 e -3, 1),
};

/// In bits.
pub(super) const DATA_BITS: Quantity = Quantity {
    expected: "a data size such as \"3Mbit\" or \"64kB\"",
    units: data_units!(1 e 0, 8),
};

pub(super) const ENERGY: Quantity = Quantity {
    expected: "an energy such as \"5J\" or \"1.2kWh\"",
    units: &[
        unit("uJ", 1, -6),
        unit("mJ", 1, -3),
        unit("J", 1, 0),
        unit("kJ", 1, 3),
        unit("MJ", 1, 6),
        unit("Wh", 36, 2),
        unit("kWh", 36, 5),
    ],
};

pub(super) const POWER: Quantity = Quantity {
    expected: "a power such as \"100mW\" or \"12W\"",
    units: &[
        unit("uW", 1, -6),
        unit("mW", 1, -3),
        unit("W", 1, 0),
        unit("kW", 1, 3),
    ],
};

/// Degrees Celsius have another zero, which who reads them adds.
pub(super) const TEMPERATURE: Quantity = Quantity {
    expected: "a temperature such as \"-40degC\" or \"233K\"",
    units: &[unit("K", 1, 0), unit("degC", 1, 0), unit("°C", 1, 0)],
};

pub(super) const RATE: Quantity = Quantity {
    expected: "a rate such as \"500k/s\" or \"2M/s\"",
    units: &[
        unit("/s", 1, 0),
        unit("k/s", 1, 3),
        unit("M/s", 1, 6),
        unit("G/s", 1, 9),
    ],
};

impl Quantity {
    /// The quantity as an exact whole number of base units; `finest` says what such a number is.
    pub(super) fn whole(&self, text: &str, finest: &'static str) -> Result<u64, UnitError> {
        let (number, symbol) = split_number(text.trim());
        let (number, unit) = self.number_and_unit(text, number, symbol)?;
        self.scaled(text, number, unit, finest)
    }

    /// The same of a sum of parts, each in a smaller unit than the one in front of it.
    pub(super) fn whole_of_parts(
        &self,
        text: &str,
        finest: &'static str,
    ) -> Result<u64, UnitError> {
        let mut rest = text.trim();
        let mut total = 0u64;
        let mut before: Option<&Unit> = None;
        loop {
            let (number, behind) = split_number(rest);
            let end = behind.find(|c: char| c.is_ascii_digit() || c == '.');
            let (symbol, behind) = behind.split_at(end.unwrap_or(behind.len()));
            let (number, unit) = self.number_and_unit(text, number, symbol.trim_end())?;
            if let Some(before) = before.filter(|before| !before.exceeds(unit)) {
                return Err(UnitError::Order {
                    found: text.to_owned(),
                    expected: self.expected,
                    unit: unit.symbol,
                    before: before.symbol,
                });
            }
            if !behind.is_empty() && number.contains('.') {
                return Err(self.out_of_range(text, "in whole numbers but for the last one"));
            }
            let part = self.scaled(text, number, unit, finest)?;
            let sum = total.checked_add(part);
            total = sum.ok_or_else(|| self.out_of_range(text, "smaller"))?;
            if behind.is_empty() {
                return Ok(total);
            }
            (before, rest) = (Some(unit), behind);
        }
    }

    /// The quantity as the `f64` nearest to what was written, in base units; not negative.
    pub(super) fn nearest(&self, text: &str) -> Result<f64, UnitError> {
        let (number, symbol) = split_number(text.trim());
        let (number, unit) = self.number_and_unit(text, number, symbol)?;
        let number = number.parse::<Decimal>();
        let number = number.map_err(|error| self.bad_number(text, error, FEWER))?;
        self.finite(text, number.nearest(unit.factor, unit.exponent))
    }

    /// The same of a quantity that may be negative.
    pub(super) fn nearest_signed(&self, text: &str) -> Result<f64, UnitError> {
        let (number, unit) = self.signed(text)?;
        self.finite(text, number.nearest(unit.factor, unit.exponent))
    }

    /// A number that may be negative, and its unit.
    pub(super) fn signed(&self, text: &str) -> Result<(Decimal, &'static Unit), UnitError> {
        let trimmed = text.trim();
        let sign = usize::from(trimmed.starts_with('-'));
        let (digits, symbol) = split_number(&trimmed[sign..]);
        let (digits, unit) = self.number_and_unit(text, digits, symbol)?;
        let number = &trimmed[..sign + digits.len()];
        let number = number.parse::<Decimal>();
        let number = number.map_err(|error| self.bad_number(text, error, FEWER))?;
        Ok((number, unit))
    }

    /// A value that was computed from `text`, or an error if there is none that is finite.
    pub(super) fn finite(&self, text: &str, value: Option<f64>) -> Result<f64, UnitError> {
        let value = value.filter(|value| value.is_finite());
        value.ok_or_else(|| self.out_of_range(text, "smaller, or in fewer digits"))
    }

    fn scaled(
        &self,
        text: &str,
        number: &str,
        unit: &Unit,
        finest: &'static str,
    ) -> Result<u64, UnitError> {
        let number = number.parse::<Decimal>();
        let value = number.and_then(|number| number.whole(unit.factor, unit.exponent));
        value.map_err(|error| self.bad_number(text, error, finest))
    }

    /// Finds the unit of a number without a sign; `text` is what messages show.
    fn number_and_unit<'a>(
        &self,
        text: &str,
        number: &'a str,
        symbol: &str,
    ) -> Result<(&'a str, &'static Unit), UnitError> {
        let digits = number.bytes().filter(u8::is_ascii_digit).count();
        if digits == 0 || number.len() - digits > 1 {
            return Err(match text.trim().strip_prefix('-') {
                Some(rest) if rest.starts_with(|c: char| c.is_ascii_digit() || c == '.') => {
                    self.out_of_range(text, "not negative")
                }
                _ => self.bad_number(text, NumberError::NotANumber, ""),
            });
        }
        if let Some(unit) = self.units.iter().find(|unit| unit.symbol == symbol) {
            return Ok((number, unit));
        }
        if symbol.is_empty() {
            return Err(self.no_unit(text.trim()));
        }
        let symbols: Vec<&str> = self.units.iter().map(|unit| unit.symbol).collect();
        Err(UnitError::WrongUnit {
            found: text.to_owned(),
            unit: symbol.to_owned(),
            expected: self.expected,
            units: symbols.join(", "),
            nearest: self.nearest_unit(symbol),
        })
    }

    /// The unit that comes closest to `symbol` in spelling.
    fn nearest_unit(&self, symbol: &str) -> Option<&'static str> {
        let near = self.units.iter().filter_map(|unit| {
            let distance = strsim::damerau_levenshtein(symbol, unit.symbol);
            let length = symbol.chars().count().max(unit.symbol.chars().count());
            (2 * distance <= length).then_some((distance, unit.symbol))
        });
        near.min_by_key(|(distance, _)| *distance)
            .map(|(_, unit)| unit)
    }

    fn bad_number(&self, text: &str, error: NumberError, finest: &'static str) -> UnitError {
        match error {
            NumberError::NotANumber => UnitError::NotAQuantity {
                found: text.to_owned(),
                expected: self.expected,
            },
            NumberError::Negative => self.out_of_range(text, "not negative"),
            NumberError::TooFine => self.out_of_range(text, finest),
            NumberError::TooLarge => self.out_of_range(text, "smaller"),
        }
    }

    pub(super) fn no_unit(&self, number: impl ToString) -> UnitError {
        UnitError::NoUnit {
            found: number.to_string(),
            expected: self.expected,
        }
    }

    pub(super) fn out_of_range(&self, found: impl ToString, bounds: &'static str) -> UnitError {
        UnitError::OutOfRange {
            found: found.to_string(),
            expected: self.expected,
            bounds,
        }
    }
}

/// What is said of a number with more digits than are read.
const FEWER: &str = "in fewer digits";

/// Digits and points at the start, and what follows them, without whitespace between.
fn split_number(text: &str) -> (&str, &str) {
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.');
    let (number, rest) = text.split_at(end.unwrap_or(text.len()));
    (number, rest.trim_start())
}
