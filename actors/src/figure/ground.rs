//! Ground in a figure, with rovers on it: contour lines, where each was and believed to be, and an arrow
//! where it is. What lies on the ground besides is the business of who draws it.

use farside_worlds::HeightField;
use maud::{Markup, html};

use super::relief;
use super::svg::{Px, over_lines, path, shortened};
use crate::rover::RoverPose;

/// Rules for the classes that are drawn with here, beside [`super::STYLE`], for
/// [`Figure::style`](super::Figure::style).
pub const STYLE: &str = include_str!("ground.css");

/// A square of ground in a figure, north up.
///
/// ```
/// use farside_actors::figure::ground::Ground;
/// use farside_worlds::HeightField;
/// use nalgebra::Point2;
/// let terrain = HeightField::new(Point2::new(-5.0, -5.0), 1.0, 11, vec![0.0; 121])?;
/// let ground = Ground {
///     terrain: &terrain,
///     corner_m: [-5.0, -5.0],
///     side_m: 10.0,
///     left: 20.0,
///     top: 40.0,
///     side: 500.0,
/// };
/// assert_eq!(ground.px([0.0, 0.0]), (270.0, 290.0));
/// assert_eq!(ground.px([-5.0, 5.0]), (20.0, 40.0));
/// assert!(!ground.is_inside((10.0, 290.0)));
/// # Ok::<(), farside_worlds::TerrainError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// The shape of the ground.
    pub terrain: &'a HeightField,
    /// What is drawn at the lower left: east, north \[m\].
    pub corner_m: [f64; 2],
    /// How wide and how high what is drawn is \[m\].
    pub side_m: f64,
    /// The x of the left edge, in pixels of the figure.
    pub left: f64,
    /// The y of the upper edge, in pixels of the figure.
    pub top: f64,
    /// How wide and how high it is, in pixels of the figure.
    pub side: f64,
}

impl Ground<'_> {
    /// The scale.
    pub fn px_per_m(&self) -> f64 {
        self.side / self.side_m
    }

    /// Where a place, east and north \[m\], is in the figure.
    pub fn px(&self, [east_m, north_m]: [f64; 2]) -> (f64, f64) {
        let [west_m, south_m] = self.corner_m;
        (
            self.left + (east_m - west_m) * self.px_per_m(),
            self.top + (south_m + self.side_m - north_m) * self.px_per_m(),
        )
    }

    /// Whether a point of the figure is on this ground.
    pub fn is_inside(&self, (x, y): (f64, f64)) -> bool {
        (self.left..=self.left + self.side).contains(&x)
            && (self.top..=self.top + self.side).contains(&y)
    }

    /// Contour lines and the edge.
    pub fn draw(&self) -> Markup {
        let (left, top, side) = (Px(self.left), Px(self.top), Px(self.side));
        let lines = relief::draw(
            self.terrain,
            self.px_per_m(),
            |at_m| self.px(at_m),
            |_| true,
        );
        html! {
            // A figure of its own, whose edge cuts what lies outside.
            svg x=(left) y=(top) width=(side) height=(side)
                viewBox={ (left) " " (top) " " (side) " " (side) } { (lines) }
            rect class="frame" x=(left) y=(top) width=(side) height=(side) {}
        }
    }

    /// Where a rover was, in truth and as it believed, and where it is.
    pub fn track(&self, name: &str, moments: &[Moment]) -> Markup {
        let line = |place_m: fn(&Moment) -> [f64; 2]| {
            path(moments.iter().map(|moment| self.px(place_m(moment))))
        };
        html! {
            path class="track" d=(line(|m| m.true_m)) { title { (name) ", in truth" } }
            path class="track believed" d=(line(|m| m.believed_m)) {
                title { (name) ", as it believes" }
            }
            @if let Some(last) = moments.last() {
                @let (x, y) = self.px(last.true_m);
                path class="rover" d=(arrow((x, y), last.yaw_rad)) { title { (name) } }
                (over_lines("who", (x, y - 12.0), "middle", &shortened(name, 12)))
            }
        }
    }
}

/// A rover at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// When \[ns since the start of the run\].
    pub time_ns: u64,
    /// Where it is: east, north \[m\].
    pub true_m: [f64; 2],
    /// Where it believes to be: east, north \[m\].
    pub believed_m: [f64; 2],
    /// Where it heads in truth \[rad, counted from east to north\].
    pub yaw_rad: f64,
}

impl Moment {
    /// What a sample of a time says.
    pub fn new(time_ns: u64, pose: &RoverPose) -> Moment {
        Moment {
            time_ns,
            true_m: [pose.east_m, pose.north_m],
            believed_m: [pose.estimated_east_m, pose.estimated_north_m],
            yaw_rad: pose.yaw_rad,
        }
    }

    /// Those of some moments, in order of time, that are not after a time.
    pub fn until(moments: &[Moment], at_ns: u64) -> &[Moment] {
        &moments[..moments.partition_point(|moment| moment.time_ns <= at_ns)]
    }
}

/// A rover as a path's data, pointed where it heads \[rad, counted from east to north\].
pub fn arrow((x, y): (f64, f64), yaw_rad: f64) -> String {
    let (sin, cos) = (libm::sin(yaw_rad), libm::cos(yaw_rad));
    let corner = |(ahead, left): (f64, f64)| {
        // Pixels count downwards.
        (x + ahead * cos - left * sin, y - ahead * sin - left * cos)
    };
    let corners = [(9.0, 0.0), (-6.0, 5.5), (-3.0, 0.0), (-6.0, -5.5)];
    format!("{}Z", path(corners.map(corner)))
}

/// A row of a legend: a sample, drawn around y 0, and what it says.
pub type LegendRow = (Markup, String);

/// From row to row of a legend, in pixels.
pub const LEGEND_ROW: f64 = 22.0;

/// The rows of a legend for what is drawn here, for [`legend`] at this x.
pub fn legend_rows(terrain: &HeightField, x: f64) -> Vec<LegendRow> {
    let line = |class: &str| {
        let data = path([(x, 0.0), (x + 26.0, 0.0)]);
        html! { path class=(class) d=(data) {} }
    };
    let rover = html! { path class="rover" d=(arrow((x + 12.0, 0.0), 0.0)) {} };
    let step_m = relief::contour_step_m(terrain);
    vec![
        (rover, "rover".to_owned()),
        (line("track"), "where it was".to_owned()),
        (line("track believed"), "where it believed to be".to_owned()),
        (line("relief key"), format!("contours every {step_m} m")),
    ]
}

/// A legend, the middle of its first row at a point of the figure.
pub fn legend(rows: &[LegendRow], (x, y): (f64, f64)) -> Markup {
    html! {
        @for (row, (sample, says)) in rows.iter().enumerate() {
            g transform={ "translate(0 " (Px(y + LEGEND_ROW * row as f64)) ")" } {
                (sample)
                text x=(Px(x + 36.0)) y="4.5" { (says) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_until_a_time_are_those_not_after_it() {
        let moment = |time_ns| Moment::new(time_ns, &RoverPose::default());
        let moments = [moment(0), moment(5), moment(5), moment(9)];
        let counts = [0, 4, 5, 8, 9].map(|at_ns| Moment::until(&moments, at_ns).len());
        assert_eq!(counts, [1, 1, 3, 3, 4]);
        assert!(Moment::until(&[], 3).is_empty());
    }

    #[test]
    fn an_arrow_points_where_the_rover_heads() {
        let north = arrow((0.0, 0.0), 0.5 * std::f64::consts::PI);
        assert!(north.starts_with("M0 -9L"), "{north}");
        let east = arrow((0.0, 0.0), 0.0);
        assert!(east.starts_with("M9 0L"), "{east}");
    }
}
