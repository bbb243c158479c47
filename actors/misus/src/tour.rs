//! Which rock a rover goes to next: of its own sector of the field, by what the tour says.

use farside::random::Stream;
use nalgebra::Point2;

/// The sector of each rock: the field is parted by angle round its middle into as many sectors as
/// there are rovers, so that nobody goes where another goes.
///
/// ```
/// use farside_misus::tour::sector;
/// use nalgebra::Point2;
/// assert_eq!(sector(Point2::new(1.0, 0.1), 4), 0);
/// assert_eq!(sector(Point2::new(-0.1, 1.0), 4), 1);
/// assert_eq!(sector(Point2::new(1.0, -0.1), 4), 3);
/// ```
pub fn sector(position_m: Point2<f64>, sectors: u32) -> u32 {
    let turn = libm::atan2(position_m.y, position_m.x) / std::f64::consts::TAU;
    let share = turn - libm::floor(turn);
    ((share * f64::from(sectors)) as u32).min(sectors - 1)
}

/// The nearest of some rocks to a place; of equally near ones the first.
pub(crate) fn nearest(
    from_m: Point2<f64>,
    rocks: impl Iterator<Item = (u32, Point2<f64>)>,
) -> Option<u32> {
    let distance = |place_m: Point2<f64>| (place_m - from_m).norm_squared();
    rocks
        .min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))
        .map(|(rock, _)| rock)
}

/// Any of some rocks.
pub(crate) fn any(rocks: &[u32], draws: &mut Stream) -> Option<u32> {
    let count = u32::try_from(rocks.len()).ok().filter(|count| *count > 0)?;
    Some(rocks[draws.below(u64::from(count)) as usize])
}

#[cfg(test)]
mod tests {
    use super::*;
    use farside::random::RandomKey;

    #[test]
    fn every_place_lies_in_one_sector_and_sectors_are_alike() {
        let mut draws = RandomKey::new(1).stream();
        let mut counts = [0_u32; 3];
        for _ in 0..30_000 {
            let place_m = Point2::new(draws.uniform_in(-9.0, 9.0), draws.uniform_in(-9.0, 9.0));
            counts[sector(place_m, 3) as usize] += 1;
        }
        assert!(
            counts.iter().all(|count| (9_000..11_000).contains(count)),
            "{counts:?}"
        );
        // The middle itself, and a place so near to the east that it rounds to a whole turn.
        assert_eq!(sector(Point2::origin(), 3), 0);
        assert!(sector(Point2::new(1.0, -1e-300), 3) < 3);
        assert_eq!(sector(Point2::new(-4.0, 2.0), 1), 0);
    }

    #[test]
    fn the_nearest_rock_is_next_and_of_equals_the_first() {
        let rocks = [
            (4, Point2::new(3.0, 0.0)),
            (7, Point2::new(0.0, 3.0)),
            (9, Point2::new(5.0, 0.0)),
        ];
        assert_eq!(nearest(Point2::origin(), rocks.into_iter()), Some(4));
        assert_eq!(nearest(Point2::new(5.0, 1.0), rocks.into_iter()), Some(9));
        assert_eq!(nearest(Point2::origin(), std::iter::empty()), None);
        let mut draws = RandomKey::new(1).stream();
        assert_eq!(any(&[], &mut draws), None);
        assert_eq!(any(&[5], &mut draws), Some(5));
    }
}
