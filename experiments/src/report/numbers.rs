//! Figures as people read them: as many digits as the interval deserves, and no more.

use farside_actors::figure::numbers::{decimal, decimals_for, plain};

use crate::stats::Estimate;

/// A figure with its unit, if it has any.
pub(super) fn with_unit(text: String, unit: &str) -> String {
    match unit {
        "" => text,
        unit => format!("{text}\u{a0}{unit}"),
    }
}

/// How a metric's figures are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    /// As they are.
    Plain,
    /// As percent: rates.
    Percent,
    /// As percentage points: differences of rates.
    Points,
}

impl Style {
    /// How a difference of such figures is written.
    pub(super) fn of_differences(self) -> Self {
        match self {
            Style::Plain => Style::Plain,
            Style::Percent | Style::Points => Style::Points,
        }
    }

    /// The number that is written: 30 for a rate of 0.3.
    pub(super) fn scaled(self, value: f64) -> f64 {
        match self {
            Style::Plain => value,
            Style::Percent | Style::Points => 100.0 * value,
        }
    }

    /// One figure, with the digits that its interval deserves.
    pub(super) fn value(self, estimate: &Estimate) -> String {
        let (value, decimals) = self.parts(estimate);
        self.unit(match decimals {
            Some(decimals) => decimal(value, decimals),
            None => plain(value),
        })
    }

    /// The interval: `1.32 to 1.48`, or that it is unknown.
    pub(super) fn interval(self, estimate: &Estimate) -> String {
        let ends = [estimate.low, estimate.high].map(|end| self.scaled(end));
        match self.parts(estimate).1 {
            Some(decimals) => {
                let [low, high] = ends.map(|end| decimal(end, decimals));
                self.unit(format!("{low} to {high}"))
            }
            // The median of what never happens to half of them has a lower end alone.
            None if ends[0].is_finite() => format!("from {}", self.unit(plain(ends[0]))),
            None => "unknown".to_owned(),
        }
    }

    /// The same with a sign: a difference.
    pub(super) fn signed(self, estimate: &Estimate) -> String {
        let text = self.value(estimate);
        if estimate.value > 0.0 && text.bytes().any(|byte| (b'1'..=b'9').contains(&byte)) {
            format!("+{text}")
        } else {
            text
        }
    }

    fn parts(self, estimate: &Estimate) -> (f64, Option<usize>) {
        let value = self.scaled(estimate.value);
        let width = self.scaled(estimate.width());
        let decimals = if width > 0.0 {
            // One digit of the width, or two if the first is small.
            decimals_for(3.0 * width)
        } else if value == value.trunc() {
            0
        } else {
            decimals_for(value.abs() / 10.0)
        };
        (value, width.is_finite().then_some(decimals))
    }

    fn unit(self, text: String) -> String {
        match self {
            Style::Plain => text,
            Style::Percent => format!("{text}\u{a0}%"),
            Style::Points => format!("{text}\u{a0}pp"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_the_digits_they_deserve() {
        let estimate = |value: f64, low: f64, high: f64| Estimate { value, low, high };
        let wide = estimate(1.4132, 1.3, 1.5);
        assert_eq!(Style::Plain.value(&wide), "1.41");
        assert_eq!(Style::Plain.interval(&wide), "1.30 to 1.50");
        let large = estimate(41234.4, 40100.0, 42800.0);
        assert_eq!(Style::Plain.value(&large), "41,234");
        let rate = estimate(0.9, 0.744, 0.965);
        assert_eq!(Style::Percent.value(&rate), "90\u{a0}%");
        assert_eq!(Style::Percent.interval(&rate), "74 to 96\u{a0}%");
        let less = estimate(-0.51, -0.6, -0.4);
        assert_eq!((Style::Plain.signed(&less)).as_str(), "−0.51");
        assert_eq!(Style::Plain.signed(&wide), "+1.41");
        assert_eq!(Style::Plain.signed(&estimate(0.0, 0.0, 0.0)), "0");
        assert_eq!(Style::Plain.interval(&Estimate::unknown(2.0)), "unknown");
        assert_eq!(Style::Plain.value(&Estimate::unknown(f64::NAN)), "–");
        assert_eq!(
            [
                plain(0.0),
                plain(12345.0),
                plain(0.01234),
                plain(-2e300),
                plain(3.1e-9)
            ],
            ["0", "12,345", "0.0123", "−2.000e300", "0.00000000310"]
        );
    }
}
