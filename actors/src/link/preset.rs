//! Links of known places, by name.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A named set of parameters; `presets.toml` beside this file has the figures, each with its
/// source or marked as an estimate.
///
/// ```
/// use farside_actors::link::{LinkParams, Preset};
/// assert!(Preset::names().any(|name| name == "mars-relay"));
/// let relay: LinkParams = toml::from_str("preset = 'mars-relay'\nrate = '2048kbit/s'")?;
/// assert_eq!(relay.rate, Some(2_048_000));
/// assert!(relay.store_and_forward);
/// # Ok::<(), toml::de::Error>(())
/// ```
///
/// # What they carry
///
/// A thousand messages of 500 bytes, at random times (exponential gaps), that take a quarter, half
/// and nine tenths of the rate, from the start on, in the first contact where there are contacts;
/// how many arrive, and after how long on average and for 99 of 100. A test counts this table anew.
///
/// | preset | share of the rate | arrive | mean delay | 99 of 100 |
/// |---|---|---|---|---|
/// | `perfect` | 1/4 | 1000 | 1 us | 1 us |
/// | `perfect` | 1/2 | 1000 | 1 us | 1 us |
/// | `perfect` | 9/10 | 1000 | 1 us | 1 us |
/// | `lunar-surface-wifi` | 1/4 | 981 | 3 ms | 6 ms |
/// | `lunar-surface-wifi` | 1/2 | 981 | 3 ms | 6 ms |
/// | `lunar-surface-wifi` | 9/10 | 981 | 5 ms | 11 ms |
/// | `lunar-relay` | 1/4 | 1000 | 98 ms | 150 ms |
/// | `lunar-relay` | 1/2 | 1000 | 108 ms | 201 ms |
/// | `lunar-relay` | 9/10 | 1000 | 186 ms | 412 ms |
/// | `earth-moon-teleop` | 1/4 | 1000 | 1.3 s | 1.3 s |
/// | `earth-moon-teleop` | 1/2 | 1000 | 1.3 s | 1.3 s |
/// | `earth-moon-teleop` | 9/10 | 1000 | 1.3 s | 1.4 s |
/// | `mars-relay` | 1/4 | 1000 | 41 ms | 91 ms |
/// | `mars-relay` | 1/2 | 1000 | 51 ms | 138 ms |
/// | `mars-relay` | 9/10 | 1000 | 129 ms | 358 ms |
/// | `mars-direct` | 1/4 | 1000 | 752.4 s | 755.5 s |
/// | `mars-direct` | 1/2 | 1000 | 753.0 s | 758.8 s |
/// | `mars-direct` | 9/10 | 1000 | 758.0 s | 772.9 s |
/// | `subsurface-mesh` | 1/4 | 936 | 32 ms | 60 ms |
/// | `subsurface-mesh` | 1/2 | 904 | 33 ms | 62 ms |
/// | `subsurface-mesh` | 9/10 | 900 | 39 ms | 68 ms |
///
/// So each carries nine tenths of its rate. Those that do not repeat (`lunar-surface-wifi`,
/// `earth-moon-teleop`, `subsurface-mesh`) lose at any load what their `loss` and `burst` say, and
/// `perfect` has no rate: it is taken to be 1 Mbit/s here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset(pub(super) usize);

/// The figures, a table for each name.
pub(super) const TEXT: &str = include_str!("presets.toml");

/// The names, in the file's order. The test holds them to the file.
pub(super) const NAMES: [&str; 7] = [
    "perfect",
    "lunar-surface-wifi",
    "lunar-relay",
    "earth-moon-teleop",
    "mars-relay",
    "mars-direct",
    "subsurface-mesh",
];

impl Preset {
    /// The preset of this name.
    pub fn find(name: &str) -> Option<Preset> {
        NAMES.iter().position(|known| *known == name).map(Preset)
    }

    /// All names.
    pub fn names() -> impl Iterator<Item = &'static str> {
        NAMES.into_iter()
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        NAMES[self.0]
    }
}

impl Serialize for Preset {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Preset {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Name;

        impl serde::de::Visitor<'_> for Name {
            type Value = Preset;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the name of a preset such as \"mars-relay\"")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Preset, E> {
                Preset::find(name).ok_or_else(|| E::unknown_variant(name, &NAMES))
            }
        }

        from.deserialize_str(Name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::{LinkOverrides, LinkParams};

    #[test]
    fn every_preset_of_the_file_can_be_named_and_read() {
        let table: toml::Table = TEXT.parse().unwrap();
        let mut names: Vec<&str> = table.keys().map(String::as_str).collect();
        let mut known = NAMES.to_vec();
        names.sort_unstable();
        known.sort_unstable();
        assert_eq!(names, known);
        for preset in NAMES.iter().filter_map(|name| Preset::find(name)) {
            let over = LinkOverrides::deserialize(table[preset.name()].clone()).unwrap();
            assert_eq!(preset.params(), LinkParams::default().with(&over));
            assert!(!preset.params().min_delay().is_zero(), "{}", preset.name());
        }
    }

    #[test]
    fn passes_carry_what_their_sources_say() {
        // MER: 128 kbit/s for 8 minutes are 60 Mbit.
        let relay = Preset::find("mars-relay").unwrap().params();
        let pass = relay.contacts.unwrap().windows()[0];
        let bits = relay.rate.unwrap() * (pass.end - pass.start).as_nanos() / 1_000_000_000;
        assert!((60_000_000..62_000_000).contains(&bits));
        // Two light times between Earth and Moon are 2.6 s.
        let teleop = Preset::find("earth-moon-teleop").unwrap().params();
        assert_eq!((teleop.latency * 2).to_string(), "2.6s");
    }
}
