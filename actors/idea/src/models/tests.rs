//! The K9's models: proved, driven at random, and case by case.

/// Makes a test of each case with each model and each technology.
macro_rules! cases {
    ($($name:ident,)*) => {
        /// All of them.
        pub(super) const CASES: &[(&str, fn(&Planned))] = &[$((stringify!($name), $name),)*];

        cases!(thorough, system, Temporal, $($name)*);
        cases!(thorough_propositional, system, Propositional, $($name)*);
        cases!(thorough_compiled, system, Compiled, $($name)*);
        cases!(light, light, Temporal, $($name)*);
        cases!(light_propositional, light, Propositional, $($name)*);
        cases!(light_compiled, light, Compiled, $($name)*);
    };
    ($of:ident, $model:ident, $technology:ident, $($name:ident)*) => {
        mod $of {
            $(#[test]
            fn $name() {
                let system = crate::models::$model().clone();
                let technology = crate::config::Technology::$technology;
                super::$name(&crate::models::tests::Planned { system, technology });
            })*
        }
    };
}

mod alarms;
mod figure_5;
mod goals;
mod mission;
mod mutants;
mod random;
mod rover;

use farside_planning::language::{Options, format, read_model};

use super::*;
use crate::config::Technology;
use crate::service::PlanService;
use crate::service::compiled::Compiled;
use crate::service::propositional::Propositional;
use crate::service::temporal::{Temporal, TemporalOptions};

/// The temporal technology with a model.
fn temporal(system: &System) -> Temporal {
    let service = Temporal::new(system.model.clone(), TemporalOptions::default());
    service.expect("all timelines are states")
}

/// A model, and what plans with it.
struct Planned {
    system: System,
    technology: Technology,
}

impl std::ops::Deref for Planned {
    type Target = System;

    fn deref(&self) -> &System {
        &self.system
    }
}

impl Planned {
    fn service(&self) -> Box<dyn PlanService> {
        let model = self.model.clone();
        match self.technology {
            Technology::Temporal => Box::new(temporal(self)),
            Technology::Propositional => Box::new(Propositional::new(model).expect("it fits")),
            Technology::Compiled => Box::new(Compiled::new(model).expect("it fits")),
        }
    }
}

#[test]
fn all_is_proved_and_in_normal_form() {
    let options = Options {
        strict: true,
        ..Options::default()
    };
    let texts = [
        ("k9-system.ddl", SYSTEM),
        ("k9-light.ddl", LIGHT),
        ("k9-mission.ddl", MISSION),
    ];
    for (name, text) in texts {
        let read = read_model(name, text, &options);
        let findings: Vec<String> = read.findings.iter().map(ToString::to_string).collect();
        assert_eq!(findings, [""; 0]);
        let formatted = format(text).expect("it is well formed");
        if std::env::var_os("FARSIDE_RENEW").is_some() {
            let path = concat!(env!("CARGO_MANIFEST_DIR"), "/models/");
            std::fs::write(path.to_owned() + name, &formatted).expect("it is written");
        }
        assert!(formatted == text, "{name} is in its normal form");
    }
}
