//! The scientist: one actor on each rover. It sends the rover from rock to rock, keeps what is read,
//! exchanges it with the other rovers, and learns from all of it. It knows no plan: what comes next
//! is decided when something has ended.
//!
//! What it has read lies in its memory, which a crash empties; then it begins a new incarnation, and
//! the others give back what they had heard. Which rocks it has been to is durable.

mod exchanging;
mod touring;

use std::collections::BTreeMap;

use farside::prelude::*;
use farside_actors::rover::{
    Command, CommandReport, RenewLease, RoverCommand, RoverHardware, RoverQuery, RoverState,
    hardware_name,
};

use crate::analysis::exchange::{Exchange, Statistics};
use crate::analysis::objective::Stories;
use crate::analysis::reading::{Origin, ReadingId};
use crate::learning::{Lesson, stories};
use crate::messages::{ExchangeDue, GoOn, LeaseDue, LessonDue, Overdue};
use crate::site::SharedSite;
use touring::{Doing, Logbook};

/// The longest that a command may take before it is stopped. A drive across the largest field in
/// hours would be longer, but tours go from rock to near rock.
const OVERDUE: SimDuration = SimDuration::from_secs(4 * 3600);

/// One rover's scientist.
pub(crate) struct Scientist {
    site: SharedSite,
    number: u32,
    exchange: Exchange,
    /// The reading that stands for a rock and an instrument, with its noise: a better one replaces it.
    kept: BTreeMap<(u32, Instrument), (ReadingId, f64)>,
    doing: Doing,
    /// The command that is waited for, and the timer that ends the wait.
    waits_for: Option<(u32, TimerId)>,
    /// Rocks since the last panoramic image; none before the first.
    since_panorama: Option<u32>,
    /// Whether something was read or heard since the last lesson.
    is_to_learn: bool,
    lesson: Option<Lesson>,
    stories: Stories,
}

/// Which kind of instrument a reading is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Instrument {
    Camera,
    Spectrometer,
}

impl Scientist {
    /// The scientist of the rover of this number.
    pub(crate) fn new(site: SharedSite, number: u32) -> Scientist {
        let stories = stories(site.side_m);
        Scientist {
            site,
            number,
            exchange: Exchange::new(Origin {
                rover: number,
                incarnation: 0,
            }),
            kept: BTreeMap::new(),
            doing: Doing::Asking,
            waits_for: None,
            since_panorama: None,
            is_to_learn: false,
            lesson: None,
            stories,
        }
    }

    fn hardware(&self, ctx: &Context<'_, Self>) -> Result<Address<RoverHardware>, HandlerError> {
        let rover = &self.site.rovers[self.number as usize];
        Ok(ctx.lookup::<RoverHardware>(&hardware_name(rover))?)
    }

    /// Gives a command, and waits for its end.
    fn command(&mut self, ctx: &mut Context<'_, Self>, doing: Doing, command: Command) -> Outcome {
        let hardware = self.hardware(ctx)?;
        let logbook = ctx.durable::<Logbook>();
        logbook.commands += 1;
        let id = logbook.commands;
        if let Some((_, timer)) = self.waits_for.take() {
            ctx.cancel(timer);
        }
        let longest = match &command {
            Command::Sleep { duration } | Command::Heat { duration } => OVERDUE + *duration,
            _ => OVERDUE,
        };
        let timer = ctx.timer(longest, Overdue { command: id });
        self.waits_for = Some((id, timer));
        self.doing = doing;
        ctx.send(hardware, RoverCommand { id, command });
        Ok(())
    }

    /// Asks the hardware how it is; the answer begins what comes next.
    fn ask(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let hardware = self.hardware(ctx)?;
        self.doing = Doing::Asking;
        ctx.send(hardware, RoverQuery { id: 0 });
        Ok(())
    }
}

impl Actor for Scientist {
    type Accepts = (
        LeaseDue,
        ExchangeDue,
        LessonDue,
        GoOn,
        Overdue,
        CommandReport,
        RoverState,
        Statistics,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.exchange = Exchange::new(Origin {
            rover: self.number,
            incarnation: ctx.incarnation(),
        });
        if let Some(every) = self.site.renew_every {
            ctx.timer(every, LeaseDue);
        }
        self.schedule_exchange(ctx);
        ctx.timer(self.site.config.learn_every, LessonDue);
        let logbook = ctx.durable::<Logbook>();
        logbook.visited.resize(self.site.catalogue.len(), false);
        if ctx.incarnation() > 0 {
            // Whatever the hardware was told before the crash is not waited for any more.
            let hardware = self.hardware(ctx)?;
            let id = 0;
            let command = Command::Stop { part: None };
            ctx.send(hardware, RoverCommand { id, command });
        }
        self.ask(ctx)
    }
}

impl Handler<LeaseDue> for Scientist {
    fn handle(&mut self, _: LeaseDue, ctx: &mut Context<'_, Self>) -> Outcome {
        let hardware = self.hardware(ctx)?;
        ctx.send(hardware, RenewLease);
        if let Some(every) = self.site.renew_every {
            ctx.timer(every, LeaseDue);
        }
        Ok(())
    }
}

impl Handler<GoOn> for Scientist {
    fn handle(&mut self, _: GoOn, ctx: &mut Context<'_, Self>) -> Outcome {
        self.ask(ctx)
    }
}

impl Handler<Overdue> for Scientist {
    fn handle(&mut self, overdue: Overdue, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.waits_for.is_some_and(|(id, _)| id == overdue.command) {
            // Its report comes at once, and is taken like any other.
            let hardware = self.hardware(ctx)?;
            let command = Command::Stop { part: None };
            ctx.send(hardware, RoverCommand { id: 0, command });
        }
        Ok(())
    }
}
