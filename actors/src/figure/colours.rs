//! Colours that the colour-blind can tell apart.

/// How many series one plot shows: that many colours, dashes and markers there are. The colours are
/// those of Okabe and Ito (*Color Universal Design*, 2008) without the yellow, which is too faint
/// on paper; they are set in `style.css`.
pub const SERIES: usize = 7;

/// How the lines are dashed, so that no one needs colours.
pub const DASHES: [&str; SERIES] = [
    "none",
    "7 3",
    "2 3",
    "9 3 2 3",
    "12 4",
    "5 2 1 2 1 2",
    "1 2",
];

/// Some points of cividis (Nuñez, Anderton and Renslow, *Optimizing Colormaps with Consideration
/// for Color Vision Deficiency*, 2018), as `matplotlib.colormaps["cividis"](i / 8)` gives them.
const CIVIDIS: [[f64; 3]; 9] = [
    [0.0, 34.0, 78.0],
    [26.0, 56.0, 111.0],
    [67.0, 78.0, 108.0],
    [97.0, 101.0, 111.0],
    [125.0, 124.0, 120.0],
    [155.0, 148.0, 118.0],
    [188.0, 174.0, 108.0],
    [222.0, 201.0, 88.0],
    [254.0, 232.0, 56.0],
];

/// A colour for a share from 0 to 1, and whether what is written on it must be light.
pub fn cividis(share: f64) -> (String, bool) {
    let share = if share.is_nan() {
        0.5
    } else {
        share.clamp(0.0, 1.0)
    };
    let at = share * (CIVIDIS.len() - 1) as f64;
    let below = (at.floor() as usize).min(CIVIDIS.len() - 2);
    let part = at - below as f64;
    let mix = |channel: usize| {
        let (low, high) = (CIVIDIS[below][channel], CIVIDIS[below + 1][channel]);
        libm::round(low + (high - low) * part) as u8
    };
    let [red, green, blue] = [mix(0), mix(1), mix(2)];
    // Where black and white differ from the colour by the same ratio (WCAG 2, relative luminance).
    let light_text = luminance([red, green, blue]) < 0.179;
    (format!("#{red:02x}{green:02x}{blue:02x}"), light_text)
}

fn luminance(colour: [u8; 3]) -> f64 {
    let linear = colour.map(|channel| {
        let share = f64::from(channel) / 255.0;
        if share <= 0.04045 {
            share / 12.92
        } else {
            libm::pow((share + 0.055) / 1.055, 2.4)
        }
    });
    0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_gets_lighter_and_is_written_on_legibly() {
        let parse =
            |colour: &str| [1, 3, 5].map(|at| u8::from_str_radix(&colour[at..at + 2], 16).unwrap());
        let mut last = -1.0;
        for step in 0..=100 {
            let (colour, light_text) = cividis(f64::from(step) / 100.0);
            let luminance = luminance(parse(&colour));
            assert!(luminance >= last, "{step}");
            last = luminance;
            let contrast = if light_text {
                1.05 / (luminance + 0.05)
            } else {
                (luminance + 0.05) / 0.05
            };
            assert!(contrast > 4.5, "{step}: {contrast}");
        }
        assert_eq!(cividis(f64::NAN).0, cividis(0.5).0);
    }
}
