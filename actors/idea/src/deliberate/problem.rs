//! A selection of goals as a problem of the model `k9-ordering.ddl`.

use std::fmt::Write as _;
use std::sync::Arc;

use farside_planning::language::{Options, read_model, read_problem};
use farside_planning::model::{Model, Problem};

use super::{Begin, DeliberationError, Settings, Target, drive_ticks};
use crate::models::ORDERING;

/// The model for so many places: `p0` is where the rover is, and the goals have the others.
pub(super) fn model(
    targets: &[Target],
    begin: &Begin,
    settings: &Settings,
) -> Result<Arc<Model>, DeliberationError> {
    let text = places(targets, begin, settings);
    let include = |_: &str| Ok(text.clone());
    let options = Options {
        strict: true,
        include: Some(&include),
        ..Options::default()
    };
    Ok(Arc::new(
        read_model("k9-ordering.ddl", ORDERING, &options).ok()?,
    ))
}

/// The text that the model includes: its places, how long drives take, and its constants.
pub(super) fn places(targets: &[Target], begin: &Begin, settings: &Settings) -> String {
    let mut places = vec![[begin.x_dm, begin.y_dm]];
    places.extend(targets.iter().map(|at| [at.x_dm, at.y_dm]));
    let mut text = String::from("(Define_Type Place (");
    for place in 0..places.len() {
        let _ = write!(text, "p{place} ");
    }
    text += "))\n(Define_Table drive_ticks\n (Place Place Ticks)";
    for (from, &at) in places.iter().enumerate() {
        for (to, &there) in places.iter().enumerate().filter(|&(to, _)| to != from) {
            let ticks = drive_ticks(at, there, settings);
            let _ = write!(text, "\n (p{from} p{to} {ticks})");
        }
    }
    let constants = [
        ("image_ticks", settings.image_ticks),
        ("drive_energy", settings.drive_energy),
        ("image_energy", settings.image_energy),
        ("reserve", settings.reserve),
    ];
    text += ")\n";
    for (name, value) in constants {
        let _ = writeln!(text, "(Define_Constant *{name}* {value})");
    }
    text
}

/// Goals that are all done, in this order.
pub(super) fn in_order(
    model: &Model,
    order: &[usize],
    begin: &Begin,
    settings: &Settings,
) -> Result<Arc<Problem>, DeliberationError> {
    let (horizon, battery) = (settings.horizon, begin.battery);
    let mut text = format!(
        "(Define_Problem order :horizon [0 {horizon}])\n\
         (Fact (SINGLE ((k9 Position_SV) ((At (p0))))) :start 0)\n\
         (Level (k9 battery) {battery})\n"
    );
    for &target in order {
        let place = target + 1;
        let _ = writeln!(
            text,
            "(Goal g{target} (SINGLE ((k9 Camera_SV) ((TakeImage (p{place}))))) :mandatory)"
        );
    }
    for pair in order.windows(2) {
        let _ = writeln!(text, "(Order (before g{} g{}))", pair[0], pair[1]);
    }
    let read = read_problem("order.ddl", &text, model, &Options::default());
    Ok(Arc::new(read.ok()?))
}
