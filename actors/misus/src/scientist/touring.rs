//! From rock to rock: what a scientist does when a command has ended, or the hardware has said how it
//! is.

use farside::prelude::*;
use farside_actors::rover::{
    Aim, Command, CommandEnd, CommandReport, Failure, PoseEstimate, Refusal, RoverState, View,
};
use farside_worlds::sky::SOL_S;
use nalgebra::{Point2, Rotation2};

use super::Scientist;
use crate::config::Tour;
use crate::messages::{GoOn, Stop};
use crate::tour;

/// How often a rover tries to get round what is in its way before it reads a rock from where it is.
const DETOURS: u32 = 4;

/// How far a rover backs up from what is in its way \[m\].
const BACK_UP_M: f64 = 1.0;

/// How long it waits where it cannot go on at once.
const WAIT: SimDuration = SimDuration::from_secs(600);

/// How long it rests where the battery is low.
const REST: SimDuration = SimDuration::from_secs(3600);

/// How long it sleeps once its tour is over.
const NOTHING_LEFT: SimDuration = SimDuration::from_secs(6 * 3600);

/// The share of the memory from which it is sent home and freed.
const MEMORY_FULL: f64 = 0.8;

/// What a scientist remembers through a crash.
#[derive(Default)]
pub(super) struct Logbook {
    /// How many commands it has given.
    pub(super) commands: u32,
    /// Which rocks it has been to, or has given up.
    pub(super) visited: Vec<bool>,
    /// How many these are.
    pub(super) stops: u32,
}

/// What a scientist waits for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Doing {
    /// The state of the hardware.
    Asking,
    /// The end of a sleep, of a transmission, or of a wait.
    Resting,
    /// An image of all around.
    Panorama,
    /// The end of a drive to a rock, or round something in the way to it.
    Driving {
        rock: u32,
        detours: u32,
        aside: bool,
    },
    /// To be a little away from what is in the way.
    BackingUp { rock: u32, detours: u32 },
    /// An image of all around, to see where a rock is that was missed.
    Searching { rock: u32 },
    /// The mast to point at a rock.
    Pointing { rock: u32, again: bool },
    /// An image of a rock.
    Imaging { rock: u32, again: bool },
    /// A spectrum of a rock.
    Reading { rock: u32 },
}

impl Handler<RoverState> for Scientist {
    fn handle(&mut self, state: RoverState, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.doing != Doing::Asking {
            return Ok(());
        }
        let reserve_j = self.site.config.reserve * state.battery_capacity_j;
        if state.brown_out || state.asleep || !state.running.is_empty() {
            return self.wait(ctx);
        }
        if self.site.is_dark(ctx.now()) {
            let duration = self.until_light(ctx.now());
            return self.command(ctx, Doing::Resting, Command::Sleep { duration });
        }
        if state.battery_j < reserve_j {
            return self.command(ctx, Doing::Resting, Command::Sleep { duration: REST });
        }
        if state.memory_used_bytes as f64 > MEMORY_FULL * state.memory_size_bytes as f64 {
            let to = "earth".to_owned();
            let size_bytes = state.memory_used_bytes;
            return self.command(ctx, Doing::Resting, Command::Transmit { to, size_bytes });
        }
        let every = self.site.config.panorama_every;
        if every > 0 && self.since_panorama.is_none_or(|rocks| rocks >= every) {
            // Without a camera for it there is none.
            self.since_panorama = Some(0);
            if let Some(camera) = self.site.instruments.panorama.clone() {
                let view = View::Panorama;
                return self.command(ctx, Doing::Panorama, Command::Image { camera, view });
            }
        }
        match self.next_rock(ctx, &state.pose) {
            Some(rock) => {
                let after = ctx.durable::<Logbook>().stops;
                ctx.sample(&Stop { rock, after });
                self.drive(ctx, &state.pose, rock, 0)
            }
            None => {
                let duration = NOTHING_LEFT;
                self.command(ctx, Doing::Resting, Command::Sleep { duration })
            }
        }
    }
}

impl Handler<CommandReport> for Scientist {
    fn handle(&mut self, report: CommandReport, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some((_, timer)) = self.waits_for.take_if(|(id, _)| *id == report.id) else {
            return Ok(());
        };
        ctx.cancel(timer);
        self.learner.keep(&report)?;
        match self.doing {
            Doing::Asking | Doing::Resting | Doing::Panorama => self.later(ctx, &report.end),
            Doing::Driving {
                rock,
                detours,
                aside,
            } => match report.end {
                CommandEnd::Done if aside => self.drive(ctx, &report.pose, rock, detours),
                CommandEnd::Failed {
                    reason: Failure::Blocked { .. },
                } if detours < DETOURS => {
                    let doing = Doing::BackingUp { rock, detours };
                    let distance_m = BACK_UP_M;
                    self.command(ctx, doing, Command::BackUp { distance_m })
                }
                // The end of the way, or of the patience: it is read from here.
                CommandEnd::Done
                | CommandEnd::Failed {
                    reason: Failure::Blocked { .. },
                } => self.point(ctx, rock, self.site.place_m(rock), false),
                end => self.later(ctx, &end),
            },
            Doing::BackingUp { rock, detours } => {
                self.go_round(ctx, &report.pose, rock, detours + 1)
            }
            Doing::Searching { rock } => match place_of(&report, rock) {
                Some(place_m) => self.point(ctx, rock, place_m, true),
                None => self.give_up(ctx, rock, &report.end),
            },
            Doing::Pointing { rock, again } => match report.end {
                CommandEnd::Done => self.image(ctx, rock, again),
                end => self.give_up(ctx, rock, &end),
            },
            // Whoever believes to be elsewhere points beside the rock: it looks round for it, once.
            Doing::Imaging { rock, again: false }
                if report.end == CommandEnd::Done && place_of(&report, rock).is_none() =>
            {
                self.search(ctx, rock)
            }
            // Without an image there is still the spectrum.
            Doing::Imaging { rock, .. } => self.spectrum(ctx, rock),
            Doing::Reading { rock } => match report.end {
                CommandEnd::Done => self.visited(ctx, rock),
                end => self.give_up(ctx, rock, &end),
            },
        }
    }
}

impl Scientist {
    /// Goes on in a while.
    fn wait(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.doing = Doing::Resting;
        ctx.timer(WAIT, GoOn);
        Ok(())
    }

    /// Goes on, in a while if a command did not end as meant: what was not done is tried again.
    fn later(&mut self, ctx: &mut Context<'_, Self>, end: &CommandEnd) -> Outcome {
        match end {
            CommandEnd::Done => self.ask(ctx),
            _ => self.wait(ctx),
        }
    }

    /// Does not try this rock again, unless the reason passes.
    fn give_up(&mut self, ctx: &mut Context<'_, Self>, rock: u32, end: &CommandEnd) -> Outcome {
        match end {
            CommandEnd::Refused {
                reason: Refusal::NotEnoughEnergy { .. } | Refusal::BrownOut | Refusal::Asleep,
            }
            | CommandEnd::Failed {
                reason: Failure::BrownOut,
            } => self.wait(ctx),
            _ => self.visited(ctx, rock),
        }
    }

    fn visited(&mut self, ctx: &mut Context<'_, Self>, rock: u32) -> Outcome {
        let logbook = ctx.durable::<Logbook>();
        logbook.visited[rock as usize] = true;
        logbook.stops += 1;
        self.since_panorama = self.since_panorama.map(|rocks| rocks + 1);
        if self.site.config.learn_at_stops {
            self.learn(ctx);
        }
        self.ask(ctx)
    }

    /// How long it is until the Sun is high enough; a rest where it never is.
    fn until_light(&self, now: SimTime) -> SimDuration {
        const STEP: SimDuration = SimDuration::from_secs(300);
        let steps = (SOL_S / STEP.as_secs_f64()) as u64;
        let waits = (1..steps).map(|count| STEP * count);
        let light = |waited: &SimDuration| !self.site.is_dark(now + *waited);
        waits.into_iter().find(light).unwrap_or(REST)
    }

    /// The rock to go to next; none once the tour is over.
    fn next_rock(&mut self, ctx: &mut Context<'_, Self>, pose: &PoseEstimate) -> Option<u32> {
        let site = self.site.clone();
        let logbook = ctx.durable::<Logbook>();
        if site.config.stops.is_some_and(|most| logbook.stops >= most) {
            return None;
        }
        let own = |rock: &u32| {
            site.sectors[*rock as usize] == self.number && !logbook.visited[*rock as usize]
        };
        let left: Vec<u32> = (0..site.catalogue.len() as u32).filter(own).collect();
        let stops = logbook.stops;
        let here_m = Point2::new(pose.east_m, pose.north_m);
        match site.config.tour {
            Tour::Fixed => {
                let places = left.iter().map(|rock| (*rock, site.place_m(*rock)));
                tour::nearest(here_m, places)
            }
            Tour::Random => {
                let mut draws = ctx.random_at("tour", u64::from(stops)).stream();
                tour::any(&left, &mut draws)
            }
            Tour::Prioritised => {
                let places = left.iter().map(|rock| (*rock, site.place_m(*rock)));
                let nearest = tour::nearest(here_m, places);
                self.most_wanted(ctx, &left).or(nearest)
            }
        }
    }

    /// Drives to a rock, or looks at it if it is near enough.
    fn drive(
        &mut self,
        ctx: &mut Context<'_, Self>,
        pose: &PoseEstimate,
        rock: u32,
        detours: u32,
    ) -> Outcome {
        let here_m = Point2::new(pose.east_m, pose.north_m);
        let way_m = here_m - self.site.place_m(rock);
        let radius_m = 0.5 * self.site.catalogue[rock as usize].diameter_m;
        let stands_m = radius_m + self.site.config.stand_off_m;
        if way_m.norm() <= stands_m {
            return self.point(ctx, rock, self.site.place_m(rock), false);
        }
        let goal_m = self.site.place_m(rock) + way_m.normalize() * stands_m;
        let doing = Doing::Driving {
            rock,
            detours,
            aside: false,
        };
        self.command(ctx, doing, to(goal_m))
    }

    /// Drives to a place beside the straight way to a rock: to the left, to the right, and farther
    /// out each time.
    fn go_round(
        &mut self,
        ctx: &mut Context<'_, Self>,
        pose: &PoseEstimate,
        rock: u32,
        detours: u32,
    ) -> Outcome {
        let here_m = Point2::new(pose.east_m, pose.north_m);
        let way_m = self.site.place_m(rock) - here_m;
        let side = if detours % 2 == 1 { 1.0 } else { -1.0 };
        let turn = Rotation2::new(side * std::f64::consts::FRAC_PI_3);
        let direction = way_m.try_normalize(1e-9);
        let direction = direction.unwrap_or_else(nalgebra::Vector2::x);
        let aside_m = 1.5 + f64::from(detours);
        let doing = Doing::Driving {
            rock,
            detours,
            aside: true,
        };
        self.command(ctx, doing, to(here_m + turn * direction * aside_m))
    }

    /// Looks round for a rock that was missed.
    fn search(&mut self, ctx: &mut Context<'_, Self>, rock: u32) -> Outcome {
        self.since_panorama = Some(0);
        match self.site.instruments.panorama.clone() {
            Some(camera) => {
                let view = View::Panorama;
                self.command(
                    ctx,
                    Doing::Searching { rock },
                    Command::Image { camera, view },
                )
            }
            None => self.spectrum(ctx, rock),
        }
    }

    fn point(
        &mut self,
        ctx: &mut Context<'_, Self>,
        rock: u32,
        place_m: Point2<f64>,
        again: bool,
    ) -> Outcome {
        let aim = Aim::Place {
            east_m: place_m.x,
            north_m: place_m.y,
        };
        self.command(
            ctx,
            Doing::Pointing { rock, again },
            Command::PanTilt { aim },
        )
    }

    fn image(&mut self, ctx: &mut Context<'_, Self>, rock: u32, again: bool) -> Outcome {
        match self.site.instruments.camera.clone() {
            Some(camera) => {
                let view = View::Point;
                self.command(
                    ctx,
                    Doing::Imaging { rock, again },
                    Command::Image { camera, view },
                )
            }
            None => self.spectrum(ctx, rock),
        }
    }

    fn spectrum(&mut self, ctx: &mut Context<'_, Self>, rock: u32) -> Outcome {
        match self.site.instruments.spectrometer.clone() {
            Some(spectrometer) => {
                let view = View::Point;
                let command = Command::Spectrum { spectrometer, view };
                self.command(ctx, Doing::Reading { rock }, command)
            }
            None => self.visited(ctx, rock),
        }
    }
}

/// Where a rock lies, as readings of it have it; none if there is no reading of it.
fn place_of(report: &CommandReport, rock: u32) -> Option<Point2<f64>> {
    let reading = report
        .readings
        .iter()
        .find(|reading| reading.rock == Some(rock))?;
    Some(Point2::new(reading.east_m, reading.north_m))
}

fn to(goal_m: Point2<f64>) -> Command {
    Command::Drive {
        east_m: goal_m.x,
        north_m: goal_m.y,
    }
}
