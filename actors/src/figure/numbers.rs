//! Numbers as people read them in figures and tables.

/// The most decimals that are ever written.
const MOST_DECIMALS: usize = 12;

/// A number with `decimals`, thousands apart from 10,000 on, and a real minus.
pub fn decimal(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return if value == f64::INFINITY {
            "never".to_owned()
        } else {
            "–".to_owned()
        };
    }
    if value.abs() >= 1e15 {
        return format!("{value:.3e}").replace('-', "−");
    }
    let text = format!("{:.*}", decimals, value.abs());
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let mut out = String::new();
    // What rounds to zero has no sign.
    if value < 0.0 && text.bytes().any(|byte| (b'1'..=b'9').contains(&byte)) {
        out.push('−');
    }
    for (at, digit) in whole.chars().enumerate() {
        if at > 0 && whole.len() > 4 && (whole.len() - at).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out + rest
}

/// How many decimals show a step of this size with two digits.
pub fn decimals_for(step: f64) -> usize {
    if !step.is_finite() || step <= 0.0 {
        return 3;
    }
    let digits = 1.0 - libm::floor(libm::log10(step));
    (digits.max(0.0) as usize).min(MOST_DECIMALS)
}

/// A number of which nothing says how exact it is: about three digits.
pub fn plain(value: f64) -> String {
    if value == value.trunc() && value.abs() < 1e15 {
        return decimal(value, 0);
    }
    decimal(value, decimals_for(value.abs() / 10.0))
}

/// A number as somebody else wrote it, with all its digits.
pub fn as_written(value: f64) -> String {
    let text = value.to_string();
    let decimals = text.split_once('.').map_or(0, |(_, rest)| rest.len());
    decimal(value, decimals.min(MOST_DECIMALS))
}
