//! The K9's models: proved, driven at random, and case by case.

/// Makes a test of each case with the thorough model and with the light one.
macro_rules! cases {
    ($($name:ident,)*) => {
        /// All of them.
        pub(super) const CASES: &[(&str, fn(&System))] = &[$((stringify!($name), $name),)*];

        mod thorough {
            $(#[test]
            fn $name() {
                super::$name(crate::models::system());
            })*
        }

        mod light {
            $(#[test]
            fn $name() {
                super::$name(crate::models::light());
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
use crate::service::temporal::{Temporal, TemporalOptions};

/// The temporal technology with a model.
fn temporal(system: &System) -> Temporal {
    let service = Temporal::new(system.model.clone(), TemporalOptions::default());
    service.expect("all timelines are states")
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
