//! Where there is room for texts beside places: none over another, and off the tracks where that can be.

/// A box in the figure: left, top, right, bottom, in pixels.
type Span = [f64; 4];

/// How far the middle of a text's edge is from its place, nearest first.
const FAR: [f64; 5] = [12.0, 22.0, 36.0, 54.0, 80.0];
/// From point to point of a line that is avoided.
const STEP: f64 = 6.0;
/// In how many directions one looks.
const DIRECTIONS: u32 = 12;

/// What is taken of a panel.
#[derive(Debug)]
pub(super) struct Room {
    within: Span,
    taken: Vec<Span>,
    avoided: Vec<(f64, f64)>,
}

impl Room {
    /// An empty panel.
    pub(super) fn new(within: Span) -> Room {
        Room {
            within,
            taken: Vec::new(),
            avoided: Vec::new(),
        }
    }

    /// A place that nothing may cover.
    pub(super) fn take(&mut self, span: Span) {
        self.taken.push(span);
    }

    /// A line that is better not covered: points of it, near to each other.
    pub(super) fn avoid_line(&mut self, (x, y): (f64, f64), (x2, y2): (f64, f64)) {
        let length = libm::hypot(x2 - x, y2 - y);
        let parts = libm::ceil(length / STEP).clamp(1.0, 1e4);
        for part in 0..=parts as u32 {
            let share = f64::from(part) / parts;
            self.avoided
                .push((x + share * (x2 - x), y + share * (y2 - y)));
        }
    }

    /// Takes room for a box of half a width and half a height beside a place; returns its middle. None if
    /// there is no room.
    pub(super) fn beside(
        &mut self,
        (x, y): (f64, f64),
        [half_width, half_height]: [f64; 2],
    ) -> Option<(f64, f64)> {
        let mut best: Option<(usize, (f64, f64))> = None;
        for far in FAR {
            for direction in 0..DIRECTIONS {
                let turn = f64::from(direction) / f64::from(DIRECTIONS) * std::f64::consts::TAU;
                let (ahead, up) = (libm::cos(turn), libm::sin(turn));
                let at = (x + ahead * (far + half_width), y - up * (far + half_height));
                let span = around(at, [half_width, half_height]);
                if !self.is_free(span) {
                    continue;
                }
                let covered = self.avoided.iter().filter(|at| holds(span, **at)).count();
                if best.is_none_or(|(least, _)| covered < least) {
                    best = Some((covered, at));
                }
            }
            if best.is_some_and(|(covered, _)| covered == 0) {
                break;
            }
        }
        let (_, at) = best?;
        self.take(around(at, [half_width + 2.0, half_height + 1.0]));
        Some(at)
    }

    fn is_free(&self, [left, top, right, bottom]: Span) -> bool {
        let within = self.within;
        let is_inside =
            left >= within[0] && top >= within[1] && right <= within[2] && bottom <= within[3];
        let overlaps = |other: &Span| {
            left < other[2] && other[0] < right && top < other[3] && other[1] < bottom
        };
        is_inside && !self.taken.iter().any(overlaps)
    }
}

fn around((x, y): (f64, f64), [half_width, half_height]: [f64; 2]) -> Span {
    [
        x - half_width,
        y - half_height,
        x + half_width,
        y + half_height,
    ]
}

fn holds([left, top, right, bottom]: Span, (x, y): (f64, f64)) -> bool {
    (left..=right).contains(&x) && (top..=bottom).contains(&y)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn nothing_is_over_another_or_outside(
            places in prop::collection::vec(((0.0..300.0, 0.0..300.0), 3.0..40.0f64), 1..40),
        ) {
            let mut room = Room::new([0.0, 0.0, 300.0, 300.0]);
            let mut spans: Vec<Span> = Vec::new();
            for (place, half_width) in places {
                let half = [half_width, 8.0];
                let Some(at) = room.beside(place, half) else { continue };
                let span = around(at, half);
                prop_assert!(span[0] >= 0.0 && span[1] >= 0.0 && span[2] <= 300.0 && span[3] <= 300.0);
                for other in &spans {
                    let apart = span[2] <= other[0] || other[2] <= span[0]
                        || span[3] <= other[1] || other[3] <= span[1];
                    prop_assert!(apart, "{span:?} over {other:?}");
                }
                spans.push(span);
            }
            prop_assert!(!spans.is_empty() || room.taken.is_empty());
        }
    }

    #[test]
    fn tracks_are_not_covered_where_there_is_room() {
        let mut room = Room::new([0.0, 0.0, 300.0, 300.0]);
        // A track to the right of the place.
        room.avoid_line((150.0, 150.0), (300.0, 150.0));
        let (x, y) = room.beside((150.0, 150.0), [20.0, 8.0]).unwrap();
        assert!((y - 150.0).abs() > 8.0 || x < 130.0, "{x} {y}");
    }
}
