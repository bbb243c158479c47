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
