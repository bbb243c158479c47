//! Where the K9's models keep what they declare: timelines, predicates and symbols by their names.

use std::sync::Arc;

use farside_planning::model::{Model, PredicateId, TimelineId, Value};

/// Declares a struct of places of a model, each with the name that it has there.
macro_rules! places {
    ($(#[$about:meta])* $name:ident: $id:ty, $find:ident {
        $($(#[$doc:meta])* $field:ident = $text:literal,)*
    }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct $name {
            $($(#[$doc])* pub $field: $id,)*
        }

        impl $name {
            fn of(model: &Model) -> Self {
                $name { $($field: $find(model, $text),)* }
            }
        }
    };
}

places! {
    /// The timelines of the system agent's model.
    SystemTimelines: TimelineId, timeline {
        /// The goal, shared with the mission agent.
        goal = "Goal_SV",
        /// Whether a goal is refused.
        completion = "Completion_SV",
        /// Commands of the wheels.
        location = "Location_SV",
        /// Commands of the cameras.
        camera = "Camera_SV",
        /// Commands of the mast.
        pan_tilt = "PanTilt_SV",
        /// Commands of the fans.
        fans = "Fans_SV",
        /// Polls of the pitch.
        pitch = "Pitch_SV",
        /// Polls of the roll.
        roll = "Roll_SV",
        /// Polls of the temperature.
        temperature = "Temperature_SV",
        /// Polls of the power.
        power = "Power_SV",
        /// How steep the last alarming pitch was.
        pitch_slope = "PitchSlope_SV",
        /// How steep the last alarming roll was.
        roll_slope = "RollSlope_SV",
        /// Which alarm there is.
        health = "MotionHealth_SV",
        /// Which step of a recovery is taken.
        monitor = "MotionMonitor_SV",
    }
}

places! {
    /// The predicates of the system agent's model.
    SystemPredicates: PredicateId, predicate {
        /// `NoGoal ()`.
        no_goal = "NoGoal",
        /// `ImageAt (x y pan tilt camera -> status)` \[dm, dm, degrees, degrees\].
        image_at = "ImageAt",
        /// `Pending ()`.
        pending = "Pending",
        /// `Refused (-> status)`.
        refused = "Refused",
        /// `Still ()`: the wheels stand.
        still = "Still",
        /// `Stop (-> status)`.
        stop = "Stop",
        /// `DriveTo (x y -> status)` \[dm\].
        drive_to = "DriveTo",
        /// `BackUp (distance -> status)` \[dm\].
        back_up = "BackUp",
        /// `TurnInPlace (angle -> status)` \[degrees\].
        turn_in_place = "TurnInPlace",
        /// `Shut ()`.
        shut = "Shut",
        /// `TakeImage (camera -> status)`.
        take_image = "TakeImage",
        /// `Rest ()`: the mast stays where it is.
        rest = "Rest",
        /// `Point (pan tilt -> status)` \[degrees\].
        point = "Point",
        /// `FansUnchanged ()`.
        fans_unchanged = "FansUnchanged",
        /// `DeviceSetFanState (on ->)`.
        set_fans = "DeviceSetFanState",
        /// `PitchMeasure (missed -> alarm pitch received)` \[degrees\].
        pitch_measure = "PitchMeasure",
        /// `RollMeasure (missed -> alarm roll received)` \[degrees\].
        roll_measure = "RollMeasure",
        /// `TempReadCompare (-> fan temperature received)` \[degrees Celsius\].
        temperature_measure = "TempReadCompare",
        /// `TempPause ()`.
        temperature_pause = "TempPause",
        /// `PowerMeasure (-> alarm charge received)` \[percent\].
        power_measure = "PowerMeasure",
        /// `PowerPause ()`.
        power_pause = "PowerPause",
        /// `Slope (size)` \[degrees\].
        slope = "Slope",
        /// `Healthy ()`.
        healthy = "Healthy",
        /// `HardLimit ()`.
        hard_limit = "HardLimit",
        /// `RollAlarm ()`.
        roll_alarm = "RollAlarm",
        /// `TiltAlarm ()`, of the pitch.
        tilt_alarm = "TiltAlarm",
        /// `BlindAlarm ()`.
        blind_alarm = "BlindAlarm",
        /// `PowerAlarm ()`.
        power_alarm = "PowerAlarm",
        /// `Nominal ()`.
        nominal = "Nominal",
        /// `Recovery (step alarm n attempt -> status)`.
        recovery = "Recovery",
        /// `Waiting (alarm n)`.
        waiting = "Waiting",
        /// `Resuming (n)`.
        resuming = "Resuming",
        /// `Safe ()`.
        safe = "Safe",
    }
}

places! {
    /// The symbols with which commands and goals end.
    Statuses: Value, symbol {
        /// It is done.
        ok = "ok",
        /// It failed.
        failed = "failed",
        /// Its time was over before a status came.
        timeout = "TIMEOUT",
        /// Something else took its place.
        preempted = "PREEMPTED",
    }
}

places! {
    /// The timelines of the mission agent's model.
    MissionTimelines: TimelineId, timeline {
        /// What the ground controllers ask for.
        ground = "Ground_SV",
        /// Deliberation.
        planner = "Planner_SV",
        /// The goal, shared with the system agent.
        goal = "Goal_SV",
    }
}

places! {
    /// The predicates of the mission agent's model.
    MissionPredicates: PredicateId, predicate {
        /// `Quiet ()`.
        quiet = "Quiet",
        /// `Request (goal x y pan tilt camera weight -> status)`.
        request = "Request",
        /// `Recall (goal x y pan tilt camera -> status)`.
        recall = "Recall",
        /// `Resting ()`.
        resting = "Resting",
        /// `Planning (h0 h1 problem -> status plan)` \[ticks\].
        planning = "Planning",
        /// `NoGoal ()`.
        no_goal = "NoGoal",
        /// `ImageAt (x y pan tilt camera -> status)` \[dm, dm, degrees, degrees\].
        image_at = "ImageAt",
    }
}

places! {
    /// The symbols with which deliberation ends.
    PlannedStatuses: Value, symbol {
        /// There is a plan.
        planned = "planned",
        /// No goal is left that can be done.
        nothing_to_do = "nothing_to_do",
        /// What it planned for is not the case any more.
        stale = "STALE",
        /// Its time was over before it was done.
        timeout = "TIMEOUT",
        /// Something else took its place.
        preempted = "PREEMPTED",
    }
}

/// The system agent's model, with its places.
#[derive(Clone, Debug)]
pub struct System {
    /// The model.
    pub model: Arc<Model>,
    /// Its timelines.
    pub timelines: SystemTimelines,
    /// Its predicates.
    pub predicates: SystemPredicates,
    /// How commands and goals end.
    pub statuses: Statuses,
}

impl System {
    /// The places of a model that declares what `k9-system.ddl` does.
    ///
    /// # Panics
    ///
    /// If it lacks something of that.
    pub fn of(model: Arc<Model>) -> Self {
        System {
            timelines: SystemTimelines::of(&model),
            predicates: SystemPredicates::of(&model),
            statuses: Statuses::of(&model),
            model,
        }
    }
}

/// The mission agent's model, with its places.
#[derive(Clone, Debug)]
pub struct Mission {
    /// The model.
    pub model: Arc<Model>,
    /// Its timelines.
    pub timelines: MissionTimelines,
    /// Its predicates.
    pub predicates: MissionPredicates,
    /// How goals end.
    pub statuses: Statuses,
    /// How deliberation ends.
    pub planned: PlannedStatuses,
}

impl Mission {
    /// The places of a model that declares what `k9-mission.ddl` does.
    ///
    /// # Panics
    ///
    /// If it lacks something of that.
    pub fn of(model: Arc<Model>) -> Self {
        Mission {
            timelines: MissionTimelines::of(&model),
            predicates: MissionPredicates::of(&model),
            statuses: Statuses::of(&model),
            planned: PlannedStatuses::of(&model),
            model,
        }
    }
}

fn timeline(model: &Model, name: &str) -> TimelineId {
    let found = model.timelines.iter().position(|at| at.name == name);
    found.unwrap_or_else(|| panic!("the model has no timeline {name}"))
}

fn predicate(model: &Model, name: &str) -> PredicateId {
    let found = model.predicates.iter().position(|at| at.name == name);
    found.unwrap_or_else(|| panic!("the model has no predicate {name}"))
}

/// The value of a symbol.
fn symbol(model: &Model, name: &str) -> Value {
    let found = model.symbols.iter().position(|at| at == name);
    found.unwrap_or_else(|| panic!("the model has no symbol {name}")) as Value
}
