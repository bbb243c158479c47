//! What cannot be run is refused before the run, by all executors alike: names that logs use, messages
//! of types that have no values.

use farside::BuildError;
use farside::prelude::*;
use farside::record::RESERVED;
use farside_tests::executors::agreed;
use serde::{Deserialize, Serialize};

struct Idle;

impl Actor for Idle {
    type Accepts = ();
}

fn called(name: &str) -> Result<Report, BuildError> {
    agreed(|heavy| {
        let mut sim = Simulation::new(1);
        let host = sim.host("a");
        if heavy {
            sim.heavy(host);
        }
        sim.actor(host, name, |_| Idle);
        sim
    })
}

#[test]
fn no_actor_is_called_as_logs_call_topics_of_their_own() {
    for first in RESERVED {
        for name in [
            first.to_owned(),
            format!("{first}/x"),
            format!("{first}/x/y"),
        ] {
            let refused = BuildError::ReservedName {
                name: name.clone(),
                first: first.to_owned(),
            };
            assert_eq!(called(&name).unwrap_err(), refused);
        }
        for name in [format!("{first}s/x"), format!("x/{first}")] {
            let report = called(&name).expect("another name");
            assert_eq!(report.end.name(), "completed", "{name}");
        }
    }
}

#[derive(Serialize, Deserialize)]
enum Never {}

#[derive(Serialize, Deserialize)]
struct Holds {
    never: Option<Never>,
}

struct Mute;

impl Actor for Mute {
    type Accepts = (Holds,);
}

impl Handler<Holds> for Mute {
    fn handle(&mut self, _message: Holds, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

#[test]
fn a_message_that_can_have_no_value_is_refused() {
    let error = agreed(|heavy| {
        let mut sim = Simulation::new(1);
        let host = sim.host("a");
        if heavy {
            sim.heavy(host);
        }
        sim.actor(host, "a", |_| Mute);
        sim
    });
    let error = error.expect_err("it cannot start").to_string();
    assert!(
        error.contains("`Holds.never`: an enum without variants"),
        "{error}"
    );
}
