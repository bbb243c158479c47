//! Rocks under a rover's wheels: they lift it on one side until it has driven off them. Faults put
//! them there.

/// The sides and corners of a rover that a rock may be under, as faults give them.
pub(super) const SIDES: [&str; 8] = [
    "front",
    "rear",
    "left",
    "right",
    "front-left",
    "front-right",
    "rear-left",
    "rear-right",
];

/// The corner that a rock is under where none is given.
pub(super) const USUAL_SIDE: &str = "front-left";

/// How far the middles of a rover's sides are lifted from the ground \[m\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lift {
    pub(super) front_m: f64,
    pub(super) rear_m: f64,
    pub(super) left_m: f64,
    pub(super) right_m: f64,
}

impl Lift {
    /// By a rock of a height under a side or a corner: one wheel of two lifts a side's middle by
    /// half.
    fn under(side: &str, height_m: f64) -> Lift {
        let is_corner = side.contains('-');
        let part = |name: &str| match (side.contains(name), is_corner) {
            (false, _) => 0.0,
            (true, true) => 0.5 * height_m,
            (true, false) => height_m,
        };
        // A whole side lifts the middles of those beside it by half, both alike: that tilts nothing.
        Lift {
            front_m: part("front"),
            rear_m: part("rear"),
            left_m: part("left"),
            right_m: part("right"),
        }
    }

    fn plus(self, other: Lift) -> Lift {
        Lift {
            front_m: self.front_m + other.front_m,
            rear_m: self.rear_m + other.rear_m,
            left_m: self.left_m + other.left_m,
            right_m: self.right_m + other.right_m,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct UnderWheel {
    fault: u32,
    lift: Lift,
    /// How far the wheels have gone, since the start, when the rover is off it \[m\].
    until_m: f64,
}

/// The rocks that are under wheels now.
#[derive(Clone, Debug, Default)]
pub(super) struct Lifts(Vec<UnderWheel>);

impl Lifts {
    /// Puts a rock of a height under a side, until the wheels have gone so far since the start.
    pub(super) fn put(&mut self, fault: u32, side: &str, height_m: f64, until_m: f64) {
        let lift = Lift::under(side, height_m);
        self.0.push(UnderWheel {
            fault,
            lift,
            until_m,
        });
    }

    /// Takes away what a fault had put there; whether there was something.
    pub(super) fn clear(&mut self, fault: u32) -> bool {
        let before = self.0.len();
        self.0.retain(|one| one.fault != fault);
        self.0.len() < before
    }

    /// All of them together.
    pub(super) fn sum(&self) -> Lift {
        let lifts = self.0.iter().map(|one| one.lift);
        lifts.fold(Lift::default(), Lift::plus)
    }

    /// The one that the rover is off first: of which fault, and how far the wheels have gone then
    /// \[m\].
    pub(super) fn next(&self) -> Option<(u32, f64)> {
        let first = |a: &&UnderWheel, b: &&UnderWheel| a.until_m.total_cmp(&b.until_m);
        let next = self.0.iter().min_by(first)?;
        Some((next.fault, next.until_m))
    }
}
