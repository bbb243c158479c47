//! What there is to know of the keys that every system shares.

use farside_actors::link::{LinkOverrides, LinkParams};
use farside_actors::radio::RadioConfig;
use farside_actors::system::settings::Table;
use farside_actors::system::{Key, Section};

use super::contacts::ContactsConfig;
use super::crash::Crash;
use super::{Deliver, Fork, LogSettings, Lose, Postpone, Shared};

/// The tables that every scenario may have, each with its keys. The first, without a name, holds
/// those at the top of the file.
///
/// ```
/// use farside_experiments::scenario::shared_sections;
/// let sections = shared_sections();
/// let links = sections.iter().find(|section| section.name == "links.default").unwrap();
/// assert!(links.keys.iter().any(|key| key.name == "loss"));
/// assert_eq!(links.defaults["latency"].as_str(), Some("5ms"));
/// ```
pub fn shared_sections() -> Vec<Section> {
    let mut all = Shared::sections("");
    all.push(Section {
        name: "links.default".to_owned(),
        about: &["The parameters of all links; [links.PATTERN] has the same for some of them."],
        keys: LinkParams::keys(),
        // A resolved scenario leaves out what is off; here it is what one wants to know.
        defaults: toml::Table::try_from(LinkOverrides::from(LinkParams::default()))
            .unwrap_or_default(),
    });
    all.push(Section {
        name: "degrade".to_owned(),
        about: &[
            "Links whose names match a pattern have other parameters for a while, or processors \
                  are slower.",
        ],
        keys: degrade_keys(),
        defaults: toml::Table::new(),
    });
    all.extend(ContactsConfig::sections("contacts"));
    all.extend(RadioConfig::sections("radios.NAME"));
    all.extend(Crash::sections("crash"));
    all.extend(Lose::sections("lose"));
    all.extend(Deliver::sections("deliver"));
    all.extend(Postpone::sections("postpone"));
    all.extend(Fork::sections("fork"));
    all.extend(LogSettings::sections("log"));
    all
}

/// The keys of a `[[degrade]]` entry: when, which, and what of a link's.
fn degrade_keys() -> Vec<Key> {
    let key = |name, about, rust| Key::new(name, about).typed(rust, "");
    let own = [
        key(
            "at",
            &["When it begins, from the start of the run."][..],
            "SimDuration",
        ),
        key(
            "until",
            &["When it ends; without, it lasts as long as the run."],
            "SimDuration",
        ),
        key(
            "links",
            &["Which links: a pattern over their names."],
            "String",
        ),
        key(
            "processors",
            &[
                "Which processors, instead of links: a pattern over their names, {host}/{processor}, \
               or over hosts.",
            ],
            "String",
        ),
        Key {
            expected: "a factor above 0, from 0.000001 to 1000000000".to_owned(),
            ..Key::new(
                "slowdown",
                &["By how much processors are slower meanwhile: 50 is a fiftieth of their speed."],
            )
        },
    ];
    own.into_iter().chain(LinkParams::keys()).collect()
}
