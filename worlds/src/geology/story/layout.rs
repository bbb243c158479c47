//! The five layouts: which part of a story is played at which place. Places are counted in sides of
//! the field, from its middle.
//!
//! Parts are numbered; which class has which part is not known here.

use std::f64::consts::TAU;

use farside::random::Stream;
use nalgebra::{Point2, Vector2};

use super::StoryKind;

/// The diameter that is neither large nor small for outwash \[m\].
const MIDDLING_M: f64 = 0.5;

/// How much less likely the weakest kind is among stones e times as large.
const WEAR_BY_SIZE: f64 = 0.5;

/// A layout with its parameters.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Layout {
    /// Beds, numbered by part and repeated.
    Strata {
        /// Across the bands.
        across: Vector2<f64>,
        width: f64,
        offset: f64,
        wave: Wave,
    },
    /// Part 0 lay deepest; the last part is the older ground.
    Ejecta {
        center: Point2<f64>,
        radius: f64,
        /// Where the blanket has thinned to half, in radii.
        reach: f64,
    },
    /// Part 0 is the core, part 1 the levees, the rest older ground; of two parts, part 1 is the
    /// older ground.
    Lava {
        along: Vector2<f64>,
        offset: f64,
        half_width: f64,
        /// The share of the half width that is levee.
        levee: f64,
        front: f64,
        wave: Wave,
    },
    /// Part 0 is the hardest, the last the weakest.
    Outwash {
        along: Vector2<f64>,
        /// How much of the weakest is lost over one side, as a logarithm.
        wear: f64,
        /// Where all kinds are as frequent, in sides from where the flood enters.
        even: f64,
    },
    /// Weights of the parts.
    Uniform { weights: Vec<f64> },
}

/// What bends a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wave {
    amplitude: f64,
    number: f64,
    phase: f64,
}

impl Wave {
    fn draw(most: f64, stream: &mut Stream) -> Wave {
        Wave {
            amplitude: stream.uniform_in(0.0, most),
            number: TAU / stream.uniform_in(0.4, 1.0),
            phase: stream.uniform_in(0.0, TAU),
        }
    }

    fn at(&self, along: f64) -> f64 {
        self.amplitude * libm::sin(self.number * along + self.phase)
    }
}

/// What a place is to a lava flow.
#[derive(Clone, Copy, PartialEq)]
enum Flow {
    Core,
    Levee,
    Outside,
}

impl Layout {
    pub(super) fn draw(kind: StoryKind, parts: usize, stream: &mut Stream) -> Layout {
        let azimuth = |stream: &mut Stream| {
            let (sine, cosine) = libm::sincos(stream.uniform_in(0.0, TAU));
            Vector2::new(cosine, sine)
        };
        match kind {
            StoryKind::Strata => {
                let across = azimuth(stream);
                let width = stream.uniform_in(0.12, 0.30);
                Layout::Strata {
                    across,
                    width,
                    offset: stream.uniform_in(0.0, width * parts as f64),
                    wave: Wave::draw(0.25 * width, stream),
                }
            }
            StoryKind::Ejecta => {
                let direction = azimuth(stream);
                Layout::Ejecta {
                    center: Point2::from(direction * stream.uniform_in(0.0, 0.45)),
                    radius: stream.uniform_in(0.10, 0.20),
                    reach: stream.uniform_in(2.5, 4.0),
                }
            }
            StoryKind::Lava => Layout::Lava {
                along: azimuth(stream),
                offset: stream.uniform_in(-0.2, 0.2),
                half_width: stream.uniform_in(0.12, 0.25),
                levee: stream.uniform_in(0.15, 0.30),
                front: stream.uniform_in(0.0, 0.5),
                wave: Wave::draw(0.08, stream),
            },
            StoryKind::Outwash => Layout::Outwash {
                along: azimuth(stream),
                wear: stream.uniform_in(4.0, 8.0),
                even: stream.uniform_in(0.3, 0.7),
            },
            StoryKind::Uniform => Layout::Uniform {
                weights: (0..parts).map(|_| 0.5 + stream.exponential(1.0)).collect(),
            },
        }
    }

    /// Writes the weight of each part at a place into the entry of the class that has it. Weights are
    /// at least 0 and one is over 0.
    pub(super) fn weights_into(
        &self,
        place: Point2<f64>,
        diameter_m: f64,
        class_of: &[u16],
        out: &mut [f64],
    ) {
        let parts = class_of.len();
        let mut put = |part: usize, weight: f64| out[usize::from(class_of[part])] = weight;
        match self {
            Layout::Strata { .. } | Layout::Lava { .. } | Layout::Ejecta { .. } => {
                (0..parts).for_each(|part| put(part, 0.0));
            }
            Layout::Outwash { .. } | Layout::Uniform { .. } => {}
        }
        match self {
            Layout::Strata { .. } => put(self.bed(place, parts), 1.0),
            Layout::Ejecta {
                center,
                radius,
                reach,
            } => {
                let radii = ((place - center).norm() / radius).max(1.0);
                let thinned = (radii / reach) * (radii / reach) * (radii / reach);
                let blanket = 1.0 / (1.0 + thinned);
                put(parts - 1, 1.0 - blanket);
                // Shells of equal ratios, up to where the blanket has thinned to half.
                let shell = (parts - 1) as f64 * libm::log(radii) / libm::log(*reach);
                match parts {
                    1 => put(0, 1.0),
                    _ => put((shell as usize).min(parts - 2), blanket),
                }
            }
            Layout::Lava { .. } => match (parts, self.flow(place)) {
                (1, _) | (2, Flow::Core | Flow::Levee) | (_, Flow::Core) => put(0, 1.0),
                (2, Flow::Outside) | (_, Flow::Levee) => put(1, 1.0),
                (_, Flow::Outside) => (2..parts).for_each(|part| put(part, 1.0)),
            },
            Layout::Outwash { along, wear, even } => {
                let way = (along.dot(&place.coords) + 0.5).clamp(-1.0, 2.0);
                let larger = libm::log(diameter_m.clamp(0.01, 10.0) / MIDDLING_M);
                let worn = wear * (way - even) + WEAR_BY_SIZE * larger;
                let weakest = (parts as f64 - 1.0).max(1.0);
                (0..parts).for_each(|part| put(part, libm::exp(-worn * part as f64 / weakest)));
            }
            Layout::Uniform { weights } => {
                weights
                    .iter()
                    .enumerate()
                    .for_each(|(part, weight)| put(part, *weight));
            }
        }
    }

    /// Which bed crops out at a place.
    fn bed(&self, place: Point2<f64>, parts: usize) -> usize {
        let Layout::Strata {
            across,
            width,
            offset,
            wave,
        } = self
        else {
            return 0;
        };
        let along = across.x * place.y - across.y * place.x;
        let beds = (across.dot(&place.coords) + wave.at(along) + offset) / width;
        let round = parts as f64;
        // The remainder of a number just below 0 can round up to the divisor.
        ((libm::floor(beds) - round * libm::floor(beds / round)) as usize).min(parts - 1)
    }

    /// How much a place is one of large rocks.
    pub(super) fn size_trend(&self, place: Point2<f64>) -> f64 {
        match self {
            Layout::Strata { .. } | Layout::Uniform { .. } => 0.0,
            Layout::Ejecta { center, radius, .. } => {
                -libm::log(((place - center).norm() / radius).max(1.0))
            }
            Layout::Lava { half_width, .. } => {
                let (aside, beyond) = self.off_axis(place);
                // How far from the margin or the front, whichever is nearer.
                let margin = (aside - half_width).abs();
                -margin.min(beyond.abs().max(aside - half_width))
            }
            Layout::Outwash { along, .. } => -along.dot(&place.coords),
        }
    }

    fn flow(&self, place: Point2<f64>) -> Flow {
        let Layout::Lava {
            half_width, levee, ..
        } = self
        else {
            return Flow::Outside;
        };
        let (aside, beyond) = self.off_axis(place);
        if beyond > 0.0 || aside > *half_width {
            Flow::Outside
        } else if aside > (1.0 - levee) * half_width || beyond > -levee * half_width {
            Flow::Levee
        } else {
            Flow::Core
        }
    }

    /// How far a place is from the flow's middle line, and how far beyond its front.
    fn off_axis(&self, place: Point2<f64>) -> (f64, f64) {
        let Layout::Lava {
            along,
            offset,
            front,
            wave,
            ..
        } = self
        else {
            return (0.0, 0.0);
        };
        let way = along.dot(&place.coords);
        let across = along.x * place.y - along.y * place.x;
        ((across - offset - wave.at(way)).abs(), way - front)
    }
}
