//! Where values go along an axis, and which of them are written beside it.

use super::numbers::{as_written, decimal, plain};

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

    /// For what is measured, with round ends: from 0 if that is not far away. By ratio if the
    /// values, all above 0, span two decades or more: evenly spaced, all but the greatest would lie
    /// on the axis.
    pub fn measured(values: impl Iterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.collect();
        let mut scale = Scale::over(values.iter().copied(), Spacing::Log);
        if spans_decades(values.into_iter()) {
            scale.low = round_below(scale.low);
            scale.high = 1.0 / round_below(1.0 / scale.high);
            return scale;
        }
        scale.spacing = Spacing::Linear;
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

    /// Whether equal ratios are equally far apart.
    pub fn is_log(&self) -> bool {
        self.spacing == Spacing::Log
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

    /// Round numbers along the axis, about `count` of them; of a logarithmic one powers of ten, and
    /// between few of those their double and fivefold.
    pub fn ticks(&self, count: f64) -> Vec<Tick> {
        if self.is_log() {
            return self.log_ticks(count);
        }
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

    fn log_ticks(&self, count: f64) -> Vec<Tick> {
        let (first, last) = (libm::log10(self.low), libm::log10(self.high));
        let decades = last - first;
        let within: &[f64] = match decades {
            few if few < 0.75 * count => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        // Of very many decades, only each so many-th.
        let stride = libm::ceil(decades / (2.0 * count)).max(1.0);
        let powers = libm::floor(first / stride) as i32..=libm::ceil(last / stride) as i32;
        let values = powers.flat_map(|power| {
            let power = f64::from(power) * stride;
            // Ten to a negative power is not exact, one over ten to a positive one is written short.
            let ten = move |digit: f64| match power < 0.0 {
                true => digit / libm::pow(10.0, -power),
                false => digit * libm::pow(10.0, power),
            };
            within.iter().map(move |digit| ten(*digit))
        });
        let on_axis = |value: &f64| {
            let slack = 1.0 + 1e-9;
            *value >= self.low / slack && *value <= self.high * slack
        };
        let tick = |value: f64| Tick {
            at: self.place(value),
            text: as_written(value),
        };
        values.filter(on_axis).map(tick).collect()
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

/// From this ratio on, values are spaced by ratio.
const DECADES: f64 = 100.0;

/// Whether values, all above 0, span two decades or more. Evenly spaced, all but the greatest would
/// lie at the end of the axis. What is not finite does not count.
pub fn spans_decades(values: impl Iterator<Item = f64>) -> bool {
    let finite = values.filter(|value| value.is_finite());
    let ends = finite.fold((f64::INFINITY, 0.0_f64), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    ends.0 > 0.0 && ends.1 / ends.0 >= DECADES
}

/// The greatest of 1, 2 and 5 times a power of ten that is not above a value.
fn round_below(value: f64) -> f64 {
    let power = libm::pow(10.0, libm::floor(libm::log10(value)));
    let steps = [5.0, 2.0, 1.0].map(|step| step * power);
    let below = steps.into_iter().find(|step| *step <= value * (1.0 + 1e-9));
    below.unwrap_or(power)
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
    fn what_spans_decades_is_spaced_by_ratio() {
        let texts = |low: f64, high: f64| -> Vec<String> {
            let scale = Scale::measured([low, high].into_iter());
            assert!(scale.is_log());
            scale.ticks(5.0).into_iter().map(|tick| tick.text).collect()
        };
        assert_eq!(
            texts(0.03, 7.0),
            ["0.02", "0.05", "0.1", "0.2", "0.5", "1", "2", "5", "10"]
        );
        assert_eq!(
            texts(3.0, 90_000.0),
            ["10", "100", "1000", "10,000", "100,000"]
        );
        assert!(!Scale::measured([0.0, 7000.0].into_iter()).is_log());
        assert!(!Scale::measured([1.0, 99.0].into_iter()).is_log());
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
