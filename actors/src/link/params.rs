//! The parameters of a link: one list, from which come all of them, some of them, the reading of
//! `[links]` and `[[degrade]]`, and what a change writes to the log.

use std::fmt;
use std::sync::OnceLock;

use farside::SimDuration;
use serde::de::{DeserializeSeed, Error, IgnoredAny, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::form::{
    DataRate, DataSize, Described, Duration, Form, Fraction, OrOff, Plain, Power, Retries,
    SomeBytes, Span, WindowSize,
};
use super::{Burst, Contacts, JitterShape, Preset, QueueLimit, Trace, preset};

/// Whether a parameter of `LinkParams` is written when it is off, as a resolved scenario is.
enum Shown {
    Always,
    IfOn,
}

macro_rules! parameters {
    ($(
        $(#[doc = $doc:literal])*
        $field:ident: $type:ty = $default:expr,
            key $key:literal $(or $alias:literal)*, as $form:ty, $shown:ident;
    )*) => {
        /// All parameters of a link. The table of keys is on the module's front page.
        ///
        /// ```
        /// use farside_actors::link::LinkParams;
        /// let text = "latency = '5ms'\njitter = '1ms'\nloss = '2%'";
        /// let params: LinkParams = toml::from_str(text)?;
        /// assert_eq!(params.loss, 0.02);
        /// assert_eq!(params.min_delay().to_string(), "4ms");
        /// # Ok::<(), toml::de::Error>(())
        /// ```
        #[derive(Clone, Debug, PartialEq)]
        pub struct LinkParams {
            $($(#[doc = $doc])* pub $field: $type,)*
        }

        /// Some parameters of a link; what is absent stays as it is.
        ///
        /// ```
        /// use farside_actors::link::LinkOverrides;
        /// let over: LinkOverrides = toml::from_str("loss = 0.3")?;
        /// assert_eq!((over.loss, over.latency), (Some(0.3), None));
        /// # Ok::<(), toml::de::Error>(())
        /// ```
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct LinkOverrides {
            /// What all parameters are replaced by, before the others here.
            pub preset: Option<Preset>,
            $($(#[doc = $doc])* pub $field: Option<$type>,)*
        }

        impl Default for LinkParams {
            fn default() -> Self {
                LinkParams { $($field: $default,)* }
            }
        }

        impl LinkParams {
            /// These parameters with some replaced.
            ///
            /// ```
            /// use farside_actors::link::{LinkOverrides, LinkParams};
            /// let out = LinkOverrides { outage: Some(true), ..LinkOverrides::default() };
            /// assert!(LinkParams::default().with(&out).outage);
            /// ```
            #[must_use]
            pub fn with(&self, over: &LinkOverrides) -> LinkParams {
                let mut params = match over.preset {
                    Some(preset) => preset.params(),
                    None => self.clone(),
                };
                $(if let Some(value) = &over.$field {
                    params.$field = value.clone();
                })*
                params
            }

            /// What has to be replaced here to get `other`.
            ///
            /// ```
            /// use farside_actors::link::LinkParams;
            /// let bad = LinkParams { loss: 0.3, ..LinkParams::default() };
            /// let over = LinkParams::default().changes_to(&bad);
            /// assert_eq!((over.loss, over.latency), (Some(0.3), None));
            /// ```
            pub fn changes_to(&self, other: &LinkParams) -> LinkOverrides {
                LinkOverrides {
                    preset: None,
                    $($field: (self.$field != other.$field).then(|| other.$field.clone()),)*
                }
            }
        }

        impl From<LinkParams> for LinkOverrides {
            fn from(params: LinkParams) -> Self {
                LinkOverrides { preset: None, $($field: Some(params.$field),)* }
            }
        }

        impl LinkParams {
            /// What there is to know of each key.
            pub fn keys() -> Vec<crate::system::Key> {
                let about = &["What all parameters are replaced by, before the others here."];
                let preset = crate::system::Key {
                    expected: Preset::said().expected,
                    ..crate::system::Key::new("preset", about)
                };
                let own = [$({
                    let said = <$form as Form>::said();
                    crate::system::Key {
                        value: said.value,
                        units: said.units,
                        expected: said.expected,
                        aliases: &[$($alias),*],
                        ..crate::system::Key::new($key, &[$($doc),*])
                    }
                }),*];
                std::iter::once(preset).chain(own).collect()
            }
        }

        /// The keys of a link's parameters.
        pub(super) const KEYS: &[&str] = &["preset", $($key,)*];

        /// The keys of a `[[degrade]]` entry.
        pub(super) const DEGRADE_KEYS: &[&str] = &[
            "at", "until", "links", "processors", "slowdown", "preset", $($key,)*
        ];

        /// The key that an alias stands for, or the key itself.
        pub(super) fn key_of(name: &str) -> Option<&'static str> {
            match name {
                "preset" => Some("preset"),
                $($key $(| $alias)* => Some($key),)*
                _ => None,
            }
        }

        impl LinkOverrides {
            /// Reads the value of one of [`KEYS`].
            pub(super) fn read<'de, A: MapAccess<'de>>(
                &mut self,
                key: &str,
                map: &mut A,
            ) -> Result<(), A::Error> {
                match key {
                    "preset" => self.preset = Some(map.next_value()?),
                    $($key => {
                        struct Seed;
                        impl<'de> DeserializeSeed<'de> for Seed {
                            type Value = $type;
                            fn deserialize<D: Deserializer<'de>>(
                                self,
                                from: D,
                            ) -> Result<$type, D::Error> {
                                <$form as Form>::read(from)
                            }
                        }
                        self.$field = Some(map.next_value_seed(Seed)?);
                    })*
                    _ => {
                        map.next_value::<IgnoredAny>()?;
                    }
                }
                Ok(())
            }

            /// Writes what is there.
            pub(super) fn write<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
                if let Some(preset) = &self.preset {
                    map.serialize_entry("preset", preset)?;
                }
                $(if let Some(value) = &self.$field {
                    struct Value<'a>(&'a $type);
                    impl Serialize for Value<'_> {
                        fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                            <$form as Form>::write(self.0, to)
                        }
                    }
                    map.serialize_entry($key, &Value(value))?;
                })*
                Ok(())
            }
        }

        impl Serialize for LinkParams {
            fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                let off = LinkParams::default();
                let shown = LinkOverrides {
                    preset: None,
                    $($field: (matches!(Shown::$shown, Shown::Always) || self.$field != off.$field)
                        .then(|| self.$field.clone()),)*
                };
                shown.serialize(to)
            }
        }
    };
}

parameters! {
    /// The one-way delay, 5 ms unless given.
    latency: SimDuration = SimDuration::from_millis(5),
        key "latency" or "delay", as Duration, Always;
    /// How far delays scatter round the latency.
    jitter: SimDuration = SimDuration::ZERO, key "jitter", as Duration, Always;
    /// How they scatter.
    ///
    /// Source: tc-netem(8), `distribution`; its pareto.c.
    jitter_shape: JitterShape = JitterShape::Uniform,
        key "jitter_shape" or "distribution", as Plain<JitterShape>, Always;
    /// How much the jitter of a message is like that of the one before it: the lag-one correlation
    /// of a Gaussian AR(1) process `z' = rho z + sqrt(1 - rho^2) e`, mapped to the shape, which
    /// keeps it.
    jitter_correlation: f64 = 0.0, key "jitter_correlation", as Fraction, IfOn;
    /// No delay is below this, whatever the jitter. Unless given, it is where the jitter ends.
    least_delay: Option<SimDuration> = None, key "min_delay", as OrOff<Duration>, IfOn;
    /// Later messages never arrive before earlier ones. It wins over `reorder`. With a `window`,
    /// what arrives waits at the receiver for what was sent before it, until that is there or given
    /// up.
    fifo: bool = false, key "fifo" or "in_order", as Plain<bool>, IfOn;
    /// The fraction of messages that are lost, each by itself.
    ///
    /// Source: tc-netem(8), `loss random`.
    loss: f64 = 0.0, key "loss", as Fraction, Always;
    /// Loss in bursts, beside that: a channel that is good or bad, and changes in time.
    ///
    /// Source: Gilbert 1960, Elliott 1963; tc-netem(8), `loss gemodel` and `loss state`.
    burst: Option<Burst> = None,
        key "burst" or "gemodel" or "loss_gemodel" or "loss_state", as OrOff<Plain<Burst>>, IfOn;
    /// The fraction of messages that set out twice, each a transmission of its own.
    duplicate: f64 = 0.0, key "duplicate", as Fraction, Always;
    /// The fraction of messages that are held back on their way by `reorder_by`, so that those sent
    /// up to that much later overtake them.
    ///
    /// Source: tc-netem(8), `reorder`, which delays the others instead.
    reorder: f64 = 0.0, key "reorder", as Fraction, IfOn;
    /// How long those are held back; the latency unless given.
    reorder_by: Option<SimDuration> = None, key "reorder_by", as OrOff<Duration>, IfOn;
    /// The fraction of messages that arrive corrupt, and are dropped there.
    corrupt: f64 = 0.0, key "corrupt", as Fraction, IfOn;
    /// The bit error rate: a message of L bytes is corrupt with `1 - (1 - ber)^(8 (L + overhead))`.
    ber: f64 = 0.0, key "ber", as Fraction, IfOn;
    /// The bit rate: a message of L bytes takes `8 (L + overhead) / rate`, rounded up to whole
    /// nanoseconds, and the next one waits.
    rate: Option<u64> = None, key "rate", as OrOff<DataRate>, IfOn;
    /// The bytes that each transmission has beside the message: headers, checksums, preambles.
    overhead: u64 = 0, key "overhead", as DataSize, IfOn;
    /// The most messages, or bytes with overhead, that wait behind the one being sent. Who comes
    /// then is lost.
    queue: Option<QueueLimit> = None,
        key "queue" or "limit", as OrOff<Plain<QueueLimit>>, IfOn;
    /// Delivery opportunities in place of a rate.
    ///
    /// Source: mahimahi(1), mm-link; Netravali et al., USENIX ATC 2015.
    trace: Option<Trace> = None, key "trace", as OrOff<Plain<Trace>>, IfOn;
    /// When the link can transmit at all, with rates and light times.
    contacts: Option<Contacts> = None,
        key "contacts", as OrOff<Plain<Contacts>>, IfOn;
    /// Messages wait for the end of an outage, and for the next contact in which their whole
    /// transmission fits.
    store_and_forward: bool = false, key "store_and_forward", as Plain<bool>, IfOn;
    /// A message whose transmission has not begun so long after it was sent is dropped.
    lifetime: Option<SimDuration> = None, key "lifetime", as OrOff<Span>, IfOn;
    /// The most bytes of a message that go in one transmission, headers apart: a longer one goes in
    /// fragments, each with an `overhead` of its own, each lost and repeated by itself, each in
    /// whatever is left of a contact. The message is there when all are, and lost when one is.
    ///
    /// Source: RFC 791, for fragments.
    mtu: Option<u64> = None, key "mtu", as OrOff<SomeBytes>, IfOn;
    /// The bytes that each fragment has beside that, and a message in one piece does not.
    fragment_header: u64 = 0, key "fragment_header", as DataSize, IfOn;
    /// How often a lost message, or fragment, is sent again.
    retries: u32 = 0, key "retries", as Retries, IfOn;
    /// With `retries`, how many messages or fragments may be under way at once, from the first that
    /// is not acknowledged on: selective repeat. 1 is stop and wait.
    ///
    /// Source: CCSDS 211.0-B (Proximity-1) and RFC 5326 (LTP).
    window: u32 = 1, key "window", as WindowSize, IfOn;
    /// The size of an acknowledgement with its headers: it takes `8 ack / ack_rate` on the way
    /// back.
    ack: u64 = 0, key "ack", as DataSize, IfOn;
    /// The bit rate of acknowledgements; that of the link back unless given.
    ack_rate: Option<u64> = None, key "ack_rate", as OrOff<DataRate>, IfOn;
    /// The fraction of acknowledgements that are lost. Unless given, and where there is a `window`,
    /// an `ack` or an `mtu`, they meet the loss, bursts, bit errors, outages and contacts of the
    /// link back; else none is lost.
    ack_loss: Option<f64> = None, key "ack_loss", as OrOff<Fraction>, IfOn;
    /// How long after a transmission began it is given up. Never below what an answer takes:
    /// the transmission, twice the latency, and the acknowledgement.
    timeout: Option<SimDuration> = None, key "timeout", as OrOff<Span>, IfOn;
    /// The name of the radio that the link goes through, one of the scenario's `[radios]`.
    radio: Option<String> = None, key "radio", as OrOff<Plain<String>>, IfOn;
    /// The power while transmitting, in watts: an attempt takes `tx_power 8 (L + overhead) / rate`
    /// from the sender.
    tx_power_w: f64 = 0.0, key "tx_power", as Power, IfOn;
    /// The power while receiving, in watts: a message that arrives takes
    /// `rx_power 8 (L + overhead) / rate` from its receiver's host.
    rx_power_w: f64 = 0.0, key "rx_power", as Power, IfOn;
    /// The link is out: everything is lost.
    outage: bool = false, key "outage", as Plain<bool>, Always;
}

impl LinkParams {
    /// The least delay that a link with these parameters gives.
    ///
    /// It is the least latency, of contacts too, less what the jitter can take, plus the time to
    /// send an empty message. A given `min_delay` stands in for the first two.
    pub fn min_delay(&self) -> SimDuration {
        let sending = self.fastest_bit_per_s().map_or(SimDuration::ZERO, |rate| {
            super::transmission_time(self.overhead, rate)
        });
        self.least_way_of_all() + sending
    }

    /// The highest bit rate \[bit/s\], in contacts too; none if there is no bound, or if a trace
    /// says when to transmit.
    pub(crate) fn fastest_bit_per_s(&self) -> Option<u64> {
        let windows = self.contacts.iter().flat_map(Contacts::windows);
        let fastest = windows
            .map(|window| window.rate.or(self.rate))
            .reduce(|a, b| {
                // No rate is the fastest of all.
                Some(a?.max(b?))
            });
        let rate = fastest.unwrap_or(self.rate);
        rate.filter(|_| self.trace.is_none())
    }

    /// Whether messages have to be followed while they are under way: in fragments, side by side,
    /// or with answers of their own. Without, all of a message is decided when it is sent.
    pub(super) fn is_followed(&self) -> bool {
        self.window > 1 || self.ack > 0 || self.ack_loss.is_some() || self.mtu.is_some()
    }

    /// The least time on the way, over all contacts.
    pub(super) fn least_way_of_all(&self) -> SimDuration {
        let windows = self.contacts.iter().flat_map(Contacts::windows);
        let latencies = windows.map(|window| window.owlt.unwrap_or(self.latency));
        self.least_way(latencies.min().unwrap_or(self.latency))
    }

    /// The least time on the way, with this latency.
    pub(super) fn least_way(&self, latency: SimDuration) -> SimDuration {
        let end_of_jitter = || {
            let least = self.jitter_shape.least() * self.jitter.as_nanos() as f64;
            let size = SimDuration::from_nanos(libm::ceil(least.abs()) as u64);
            match least < 0.0 {
                true => latency - size,
                // Rounded down, for delays are.
                false => latency + SimDuration::from_nanos(least as u64),
            }
        };
        self.least_delay.unwrap_or_else(end_of_jitter)
    }
}

/// Reads a key: one of `keys`, or an alias of one, not seen before.
pub(super) struct Key<'a> {
    pub(super) keys: &'static [&'static str],
    pub(super) seen: &'a mut Seen,
}

/// The keys that were read before, each with the name that was used.
pub(super) type Seen = Vec<(&'static str, String)>;

impl<'de> DeserializeSeed<'de> for Key<'_> {
    type Value = &'static str;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<&'static str, D::Error> {
        from.deserialize_identifier(self)
    }
}

impl Visitor<'_> for Key<'_> {
    type Value = &'static str;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a parameter of links")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<&'static str, E> {
        let own = self.keys.iter().copied().find(|key| *key == name);
        let Some(key) = own.or_else(|| key_of(name)) else {
            return Err(E::unknown_field(name, self.keys));
        };
        if let Some((_, before)) = self.seen.iter().find(|(known, _)| *known == key) {
            return Err(E::custom(format!(
                "`{before}` and `{name}` are names of one key, `{key}`: expected one of them (what \
                 --set puts in the place of a key goes by the name that is there)"
            )));
        }
        self.seen.push((key, name.to_owned()));
        Ok(key)
    }
}

impl Serialize for LinkOverrides {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(None)?;
        self.write(&mut map)?;
        map.end()
    }
}

impl<'de> Deserialize<'de> for LinkOverrides {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Table;

        impl<'de> Visitor<'de> for Table {
            type Value = LinkOverrides;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of a link's parameters")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<LinkOverrides, A::Error> {
                let mut over = LinkOverrides::default();
                let mut seen = Vec::new();
                loop {
                    let seed = Key {
                        keys: KEYS,
                        seen: &mut seen,
                    };
                    let Some(key) = map.next_key_seed(seed)? else {
                        return Ok(over);
                    };
                    over.read(key, &mut map)?;
                }
            }
        }

        from.deserialize_map(Table)
    }
}

impl<'de> Deserialize<'de> for LinkParams {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let over = LinkOverrides::deserialize(from)?;
        Ok(LinkParams::default().with(&over))
    }
}

/// The parameters of each preset, read once.
fn presets() -> &'static [LinkParams] {
    static ALL: OnceLock<Vec<LinkParams>> = OnceLock::new();
    ALL.get_or_init(|| {
        let table = preset::TEXT.parse::<toml::Table>().unwrap_or_default();
        let read = |name: &&str| {
            let over = table.get(*name).cloned();
            let over = over.map(LinkOverrides::deserialize).and_then(Result::ok);
            LinkParams::default().with(&over.unwrap_or_default())
        };
        preset::NAMES.iter().map(read).collect()
    })
}

impl Preset {
    /// Its parameters.
    pub fn params(self) -> LinkParams {
        presets()[self.0].clone()
    }
}
