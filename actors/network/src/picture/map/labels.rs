//! Where names go on a map: beside what they name, and not over what matters.

use farside_actors::figure::scale::text_width;

/// The size of names, in pixels.
const SIZE: f64 = 12.0;

/// A part of the map that is taken, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
}

impl Rect {
    /// The square round a place.
    pub(super) fn around((x, y): (f64, f64), reach: f64) -> Self {
        Rect {
            left: x - reach,
            top: y - reach,
            right: x + reach,
            bottom: y + reach,
        }
    }

    /// How much of two parts lies over each other.
    fn shared(&self, other: &Rect) -> f64 {
        let width = self.right.min(other.right) - self.left.max(other.left);
        let height = self.bottom.min(other.bottom) - self.top.max(other.top);
        width.max(0.0) * height.max(0.0)
    }
}

/// The names on a map.
pub(super) struct Labels {
    taken: Vec<Rect>,
}

impl Labels {
    pub(super) fn new(taken: Vec<Rect>) -> Self {
        Labels { taken }
    }

    /// Where the middle of a name's foot goes, for something that reaches so far round its middle:
    /// above it, below, beside, at a corner; of these the first that covers nothing, or the one that
    /// covers least.
    pub(super) fn place(&mut self, (x, y): (f64, f64), reach: f64, text: &str) -> (f64, f64) {
        // Names are bold.
        let half = 0.56 * text_width(text, SIZE);
        let (beside, above) = (reach + half + 1.5, reach + 1.5);
        let below = reach + SIZE - 1.0;
        let level = 0.35 * SIZE;
        let places = [
            (0.0, -above),
            (0.0, below),
            (beside, level),
            (-beside, level),
            (beside, -above + 4.0),
            (-beside, -above + 4.0),
            (beside, below - 4.0),
            (-beside, below - 4.0),
        ];
        let rect = |(dx, dy): (f64, f64)| Rect {
            left: x + dx - half,
            top: y + dy - 0.75 * SIZE,
            right: x + dx + half,
            bottom: y + dy + 1.0,
        };
        let covered = |place: (f64, f64)| -> f64 {
            let own = rect(place);
            self.taken.iter().map(|other| own.shared(other)).sum()
        };
        let covered = places.map(|place| (covered(place), place));
        // Of equals the first.
        let least = covered.iter().fold(
            covered[0],
            |best, one| if one.0 < best.0 { *one } else { best },
        );
        self.taken.push(rect(least.1));
        (x + least.1.0, y + least.1.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_off_what_is_there() {
        let mut free = Labels::new(Vec::new());
        let (x, y) = free.place((50.0, 50.0), 7.0, "N12");
        assert!(x == 50.0 && y < 43.0, "above: {x}, {y}");
        // Something above, and a name of its own already below.
        let mut crowded = Labels::new(vec![Rect::around((50.0, 36.0), 7.0)]);
        assert!(crowded.place((50.0, 50.0), 7.0, "N12").1 > 57.0);
        let (x, _) = crowded.place((50.0, 50.0), 7.0, "N3");
        assert!(x > 57.0, "{x}");
        // Without any room it lies where it covers least.
        let mut full = Labels::new(vec![Rect::around((50.0, 50.0), 100.0)]);
        full.place((50.0, 50.0), 7.0, "N3");
    }
}
