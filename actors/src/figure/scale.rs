//! Where values go along an axis, and which of them are written beside it.

use super::numbers::{decimal, plain};

/// How values are spaced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spacing {
    /// Equal steps are equally far apart.
    Linear,
    /// Equal ratios are equally far apart.
    Log,
}

/// An axis: values from `low` to `high` at 0 to 1.
#[derive(Clone, Debug)]
pub struct Scale {
    low: f64,
    high: f64,
    spacing: Spacing,
}

/// A place along an axis, from 0 to 1, and what is written there.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Where it is, from 0 to 1.
    pub at: f64,
    /// What is written there.
    pub text: String,
}

impl Scale {
    /// Holds all `values`, and more than nothing. A logarithmic axis needs values above 0: with
    /// others it is linear.
    pub fn over(values: impl Iterator<Item = f64>, spacing: Spacing) -> Self {
        let mut low = f64::INFINITY;
        let mut high = f64::NEG_INFINITY;
        for value in values.filter(|value| value.is_finite()) {
            low = low.min(value);
            high = high.max(value);
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let spacing = if low > 0.0 { spacing } else { Spacing::Linear };
        if low == high {
            let reach = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
            (low, high) = (low - reach, high + reach);
        }
        Scale { low, high, spacing }
    }

    /// For what is measured: from 0 if that is not far away, with round ends.
    pub fn measured(values: impl Iterator<Item = f64>) -> Self {
        let mut scale = Scale::over(values, Spacing::Linear);
        if scale.low > 0.0 && scale.low < 0.5 * scale.high {
            scale.low = 0.0;
        }
        let step = scale.step(5.0);
        scale.low = step * libm::floor(scale.low / step + 1e-9);
        scale.high = step * libm::ceil(scale.high / step - 1e-9);
        scale
    }

    /// From exactly `low` to `high`.
    pub fn between(low: f64, high: f64) -> Self {
        Scale {
            low,
            high,
            spacing: Spacing::Linear,
        }
    }

    /// The upper end.
    pub fn high(&self) -> f64 {
        self.high
    }

    /// Where a value goes, 0 to 1, if it is on the axis.
    pub fn place(&self, value: f64) -> f64 {
        let place = match self.spacing {
            Spacing::Linear => (value - self.low) / (self.high - self.low),
            Spacing::Log => libm::log(value / self.low) / libm::log(self.high / self.low),
        };
        if place.is_nan() {
            0.0
        } else {
            place.clamp(0.0, 1.0)
        }
    }

    /// Round numbers along a linear axis, about `count` of them.
    pub fn ticks(&self, count: f64) -> Vec<Tick> {
        let step = self.step(count);
        let decimals = (0..12).find(|decimals| {
            let scaled = step * libm::pow(10.0, f64::from(*decimals));
            (scaled - libm::round(scaled)).abs() < 1e-6
        });
        let decimals = decimals.unwrap_or(12) as usize;
        let first = libm::ceil(self.low / step - 1e-9);
        let last = libm::floor(self.high / step + 1e-9);
        // A step is a fifth to a tenth of the axis, so there are few.
        let count = (last - first).clamp(0.0, 50.0) as u32;
        let value = |index: u32| (first + f64::from(index)) * step;
        (0..=count)
            .map(|index| Tick {
                at: self.place(value(index)),
                text: if step >= 1.0 {
                    plain(value(index))
                } else {
                    decimal(value(index), decimals)
                },
            })
            .collect()
    }

    /// 1, 2 or 5 times a power of ten.
    fn step(&self, count: f64) -> f64 {
        let rough = (self.high - self.low) / count;
        let power = libm::pow(10.0, libm::floor(libm::log10(rough)));
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .find(|step| step * power >= rough * 0.999);
        step.unwrap_or(10.0) * power
    }
}

/// The width of a text of this size, roughly: nobody measures fonts here.
pub fn text_width(text: &str, size: f64) -> f64 {
    let width = |letter: char| match letter {
        'i' | 'j' | 'l' | '.' | ',' | ' ' | '\'' | '|' | ':' => 0.32,
        'm' | 'w' | 'M' | 'W' | '%' => 0.88,
        letter if letter.is_ascii_uppercase() => 0.68,
        letter if letter.is_ascii() => 0.56,
        _ => 0.9,
    };
    text.chars().map(width).sum::<f64>() * size
}

/// Leaves out what would run into what is written already, the ends first of all kept.
pub fn thinned(ticks: &[Tick], length: f64, size: f64) -> Vec<Tick> {
    let span = |tick: &Tick| {
        let half = text_width(&tick.text, size) / 2.0 + 4.0;
        (tick.at * length - half, tick.at * length + half)
    };
    let mut kept: Vec<Tick> = Vec::new();
    let last = ticks.len().saturating_sub(1);
    let ends = [last, 0].into_iter().chain(1..last);
    for tick in ends.filter_map(|index| ticks.get(index)) {
        let (from, to) = span(tick);
        let free = |other: &Tick| {
            let (start, end) = span(other);
            to <= start || end <= from
        };
        if kept.iter().all(free) {
            kept.push(tick.clone());
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_on_the_axis() {
        let texts = |low: f64, high: f64| -> Vec<String> {
            let scale = Scale::measured([low, high].into_iter());
            scale.ticks(5.0).into_iter().map(|tick| tick.text).collect()
        };
        assert_eq!(texts(1.1, 4.3), ["0", "1", "2", "3", "4", "5"]);
        assert_eq!(
            texts(0.0, 0.23),
            ["0.00", "0.05", "0.10", "0.15", "0.20", "0.25"]
        );
        assert_eq!(texts(9500.0, 24000.0).last().unwrap(), "25,000");
        assert_eq!(texts(-0.3, 0.1).first().unwrap(), "−0.3");
        for value in [0.0, 3.0, -2.5, f64::NAN, 1e-9, 1e12] {
            let scale = Scale::measured([value].into_iter());
            let ticks = scale.ticks(5.0);
            assert!((2..=12).contains(&ticks.len()), "{value}: {ticks:?}");
            assert!(ticks.iter().all(|tick| (0.0..=1.0).contains(&tick.at)));
        }
    }

    #[test]
    fn logarithms_need_values_above_nothing() {
        let scale = Scale::over([1.0, 100.0].into_iter(), Spacing::Log);
        assert!((scale.place(10.0) - 0.5).abs() < 1e-12);
        let scale = Scale::over([0.0, 100.0].into_iter(), Spacing::Log);
        assert_eq!(scale.place(50.0), 0.5);
    }

    #[test]
    fn texts_do_not_run_into_each_other() {
        let tick = |at: f64, text: &str| Tick {
            at,
            text: text.to_owned(),
        };
        let ticks = [
            tick(0.0, "5ms"),
            tick(0.07, "100ms"),
            tick(0.46, "600ms"),
            tick(1.0, "1.3s"),
        ];
        let kept: Vec<String> = thinned(&ticks, 380.0, 13.0)
            .into_iter()
            .map(|tick| tick.text)
            .collect();
        assert_eq!(kept, ["1.3s", "5ms", "600ms"]);
        assert!(thinned(&[], 1.0, 1.0).is_empty());
    }
}
