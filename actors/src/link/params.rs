//! The parameters of a link: all of them, some of them, and as a change that logs can hold.

use farside::SimDuration;
use serde::{Deserialize, Serialize};

use crate::units;

/// How delays scatter round the latency.
///
/// ```
/// use farside_actors::link::JitterShape;
/// assert_eq!(JitterShape::default(), JitterShape::Uniform);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum JitterShape {
    /// Evenly, by at most the jitter to either side.
    #[default]
    Uniform,
    /// Normally, with the jitter as standard deviation, cut at three of them to either side.
    Normal,
}

impl JitterShape {
    /// Where the normal shape is cut, in standard deviations.
    pub const NORMAL_SPREAD: u32 = 3;
}

/// All parameters of a link.
///
/// ```
/// use farside_actors::link::LinkParams;
/// let params: LinkParams = toml::from_str("latency = '5ms'\njitter = '1ms'\nloss = '2%'")?;
/// assert_eq!(params.loss, 0.02);
/// assert_eq!(params.min_delay().to_string(), "4ms");
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LinkParams {
    /// The one-way delay, 5 ms unless given.
    #[serde(with = "units::duration")]
    pub latency: SimDuration,
    /// How far delays scatter round the latency.
    #[serde(with = "units::duration")]
    pub jitter: SimDuration,
    /// How they scatter.
    pub jitter_shape: JitterShape,
    /// No delay is below this, whatever the jitter. Unless given, it is where the jitter ends.
    #[serde(
        rename = "min_delay",
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub least_delay: Option<SimDuration>,
    /// The fraction of messages that are lost, each by itself.
    #[serde(with = "units::fraction")]
    pub loss: f64,
    /// The fraction of messages that set out twice.
    #[serde(with = "units::fraction")]
    pub duplicate: f64,
    /// The link is out: everything is lost.
    pub outage: bool,
}

impl Default for LinkParams {
    fn default() -> Self {
        LinkParams {
            latency: SimDuration::from_millis(5),
            jitter: SimDuration::ZERO,
            jitter_shape: JitterShape::Uniform,
            least_delay: None,
            loss: 0.0,
            duplicate: 0.0,
            outage: false,
        }
    }
}

impl LinkParams {
    /// The least delay that a link with these parameters gives.
    pub fn min_delay(&self) -> SimDuration {
        let spread = match self.jitter_shape {
            JitterShape::Uniform => self.jitter,
            JitterShape::Normal => self.jitter * u64::from(JitterShape::NORMAL_SPREAD),
        };
        let end_of_jitter = self.latency - spread;
        self.least_delay.unwrap_or(end_of_jitter)
    }

    /// These parameters with some replaced.
    ///
    /// ```
    /// use farside_actors::link::{LinkOverrides, LinkParams};
    /// let out = LinkOverrides { outage: Some(true), ..LinkOverrides::default() };
    /// assert!(LinkParams::default().with(&out).outage);
    /// ```
    #[must_use]
    pub fn with(&self, over: &LinkOverrides) -> LinkParams {
        LinkParams {
            latency: over.latency.unwrap_or(self.latency),
            jitter: over.jitter.unwrap_or(self.jitter),
            jitter_shape: over.jitter_shape.unwrap_or(self.jitter_shape),
            least_delay: over.least_delay.or(self.least_delay),
            loss: over.loss.unwrap_or(self.loss),
            duplicate: over.duplicate.unwrap_or(self.duplicate),
            outage: over.outage.unwrap_or(self.outage),
        }
    }
}

/// Some parameters of a link; what is absent stays as it is.
///
/// ```
/// use farside_actors::link::LinkOverrides;
/// let over: LinkOverrides = toml::from_str("loss = 0.3")?;
/// assert_eq!((over.loss, over.latency), (Some(0.3), None));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LinkOverrides {
    /// See [`LinkParams::latency`], and so on.
    #[serde(
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub latency: Option<SimDuration>,
    /// The jitter.
    #[serde(
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub jitter: Option<SimDuration>,
    /// The jitter's shape.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jitter_shape: Option<JitterShape>,
    /// The least delay.
    #[serde(
        rename = "min_delay",
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub least_delay: Option<SimDuration>,
    /// The loss.
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub loss: Option<f64>,
    /// The duplication.
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub duplicate: Option<f64>,
    /// The outage.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outage: Option<bool>,
}

/// What a control event tells a link, and what the log shows of it: all parameters, from now on.
///
/// ```
/// use farside_actors::link::{LinkChange, LinkParams};
/// let change = LinkChange::from(LinkParams::default());
/// assert_eq!(change.latency_ns, 5_000_000);
/// assert_eq!(LinkParams::from(change), LinkParams::default());
/// ```
// Apart from `LinkParams`, because messages are plain numbers where scenarios have units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkChange {
    /// The one-way delay in nanoseconds.
    pub latency_ns: u64,
    /// The jitter in nanoseconds.
    pub jitter_ns: u64,
    /// The jitter's shape.
    pub jitter_shape: JitterShape,
    /// The least delay in nanoseconds, if one is set.
    pub min_delay_ns: Option<u64>,
    /// The fraction of messages that are lost.
    pub loss: f64,
    /// The fraction of messages that set out twice.
    pub duplicate: f64,
    /// The link is out.
    pub outage: bool,
}

impl From<LinkParams> for LinkChange {
    fn from(params: LinkParams) -> Self {
        LinkChange {
            latency_ns: params.latency.as_nanos(),
            jitter_ns: params.jitter.as_nanos(),
            jitter_shape: params.jitter_shape,
            min_delay_ns: params.least_delay.map(SimDuration::as_nanos),
            loss: params.loss,
            duplicate: params.duplicate,
            outage: params.outage,
        }
    }
}

impl From<LinkChange> for LinkParams {
    fn from(change: LinkChange) -> Self {
        LinkParams {
            latency: SimDuration::from_nanos(change.latency_ns),
            jitter: SimDuration::from_nanos(change.jitter_ns),
            jitter_shape: change.jitter_shape,
            least_delay: change.min_delay_ns.map(SimDuration::from_nanos),
            loss: change.loss,
            duplicate: change.duplicate,
            outage: change.outage,
        }
    }
}
