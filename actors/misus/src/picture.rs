//! Pictures of a run, drawn from its log alone: the field with what is known of it, and a rover's
//! resources over time. The same log gives the same bytes.

pub(crate) mod account;
mod classes;
mod field;
mod history;
mod profiles;

use std::sync::LazyLock;

use farside::SimDuration;
use farside::suggest::{did_you_mean, nearest};
use farside_actors::field::{FieldConfig, Place};
use farside_actors::figure::numbers::plain;
use farside_actors::figure::{Figure, ground};
use farside_actors::rover::RoverConfig;
use farside_actors::system::{
    PictureError, PictureInfo, PictureOption, PictureRequest, Recording, Setup,
};

use farside_worlds::sky::SOL_S;

use crate::assemble::names;
use crate::chart;
use crate::config::TeamConfig;
use history::History;

/// The style of pictures, beside that of all figures.
static STYLE: LazyLock<String> = LazyLock::new(|| {
    [
        ground::STYLE,
        chart::STYLE,
        include_str!("picture/picture.css"),
    ]
    .concat()
});

/// The pictures that there are.
pub(crate) const ALL: [PictureInfo; 2] = [
    PictureInfo {
        name: "field",
        about: "rocks by what they are and by what a rover thinks they are, readings and tracks at an \
                instant: --along names the rover, the first unless given",
        takes: &[PictureOption::At, PictureOption::Along],
        extras: &[],
    },
    PictureInfo {
        name: "profiles",
        about: "a rover's battery, power and memory over time, with nights and faults: --along names \
                the rover, the first unless given",
        takes: &[PictureOption::At, PictureOption::From, PictureOption::Along],
        extras: &[],
    },
];

/// Draws one of them, of a run with this world, team and these rovers.
pub(crate) fn draw(
    (world, team, rover_config): (&FieldConfig, &TeamConfig, &RoverConfig),
    picture: &str,
    run: &dyn Recording,
    request: &PictureRequest,
    setup: &mut Setup<'_>,
) -> Result<Figure, PictureError> {
    let place = Place::of(world, setup)?;
    let history = History::read(run, names(team))?;
    let rover = rover(&history.names, request.along.as_deref())?;
    match picture {
        "field" => {
            let at_ns = chart::time_ns(history.end_ns, request.at)?;
            Ok(field::figure(&history, &place.field, rover, at_ns))
        }
        "profiles" => {
            let span = chart::span_ns(history.end_ns, request)?;
            let capacity = [rover_config.battery_j, rover_config.memory_bytes as f64];
            Ok(profiles::figure(&history, &place, capacity, rover, span))
        }
        other => Err(PictureError::Unknown {
            picture: other.to_owned(),
        }),
    }
}

/// Which rover is meant.
pub(crate) fn rover(names: &[String], wanted: Option<&str>) -> Result<usize, PictureError> {
    let Some(wanted) = wanted else {
        return Ok(0);
    };
    let found = names.iter().position(|name| name == wanted);
    found.ok_or_else(|| {
        let hint = nearest(wanted, names.iter().map(String::as_str));
        let hint = did_you_mean(hint.as_deref());
        let known = names.join(", ");
        PictureError::NotDrawn(format!(
            "along {wanted:?}: expected a rover, one of {known}{hint}"
        ))
    })
}

/// A time of a run in sols, to a thousandth.
pub(crate) fn in_sols(time: SimDuration) -> String {
    format!(
        "{} sol",
        plain(libm::round(time.as_secs_f64() / SOL_S * 1e3) / 1e3)
    )
}
