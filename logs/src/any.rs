//! Reading the messages of any MCAP file, one after the other, as values.

use std::path::Path;
use std::sync::Arc;

use farside::suggest::{did_you_mean, nearest};

use crate::LogError;
use crate::channel::ChannelInfo;
use crate::envelope::RecordRef;
use crate::fields;
use crate::scan::{Item, Position, ScannedMessage, Scanner};
use crate::topics::Topics;
use crate::value::Unreadable;
use crate::value::Value;

/// A message of any MCAP file.
pub struct AnyMessage<'a> {
    message: ScannedMessage<'a>,
    channels: &'a [Arc<ChannelInfo>],
}

impl<'a> AnyMessage<'a> {
    /// Its topic.
    pub fn topic(&self) -> &'a str {
        &self.message.channel.topic
    }

    /// Its channel: encoding, schema, metadata.
    pub fn channel(&self) -> &'a ChannelInfo {
        self.message.channel
    }

    pub(crate) fn position(&self) -> Position {
        self.message.position
    }

    /// When it was logged, in nanoseconds since whatever the log counts from.
    pub fn log_time_ns(&self) -> u64 {
        self.message.head.log_time
    }

    /// When it was published, in nanoseconds.
    pub fn publish_time_ns(&self) -> u64 {
        self.message.head.publish_time
    }

    /// The number that its publisher gave it; 0 if it gave none.
    pub fn sequence(&self) -> u32 {
        self.message.head.sequence
    }

    /// Its bytes, as they are encoded.
    pub fn data(&self) -> &'a [u8] {
        self.message.data
    }

    /// The record of a Farside run that it holds; none if it is a message of another program, a state sample,
    /// something that viewers draw, or malformed.
    ///
    /// ```no_run
    /// let mut messages = farside_logs::AnyMessages::open("run.mcap", &[])?;
    /// while let Some(message) = messages.next()? {
    ///     if let Some(record) = message.record() {
    ///         println!("{} {}", record.key.time_ns, record.receiver);
    ///     }
    /// }
    /// # Ok::<(), farside_logs::LogError>(())
    /// ```
    pub fn record(&self) -> Option<RecordRef<'a>> {
        match self.message.channel.role() {
            "message" | "event" => RecordRef::read(self.message.data),
            _ => None,
        }
    }

    /// What it says.
    ///
    /// # Errors
    /// If its encoding is not known, or it does not hold what its schema says.
    pub fn value(&self) -> Result<Value<'a>, Unreadable> {
        fields::value(self.message.channel, self.message.data, self.channels)
    }
}

/// The messages of any MCAP file, in the order of the file.
///
/// CDR with `ros2msg` and `ros2idl` schemas, ROS 1, protobuf, JSON and FlatBuffers are read.
///
/// ```no_run
/// let mut messages = farside_logs::AnyMessages::open("run.mcap", &["/imu".to_owned()])?;
/// while let Some(message) = messages.next()? {
///     let value = message.value()?;
///     let z = value.at("linear_acceleration.z").and_then(|z| z.as_f64());
///     println!("{} {:?}", message.log_time_ns(), z);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct AnyMessages {
    scanner: Scanner,
    globs: Vec<(String, Topics, bool)>,
    /// By the serial number of a channel, whether its messages are wanted.
    wanted: Vec<Option<bool>>,
    cut: Option<String>,
}

impl AnyMessages {
    /// Opens a file. Of its messages those are read whose topic matches one of the globs; all, if there is
    /// none.
    ///
    /// # Errors
    /// If the file is no MCAP file, or a glob is none.
    pub fn open(path: impl AsRef<Path>, topics: &[String]) -> Result<AnyMessages, LogError> {
        let glob = |glob: &String| {
            let topics = Topics::new(std::slice::from_ref(glob))?;
            Ok((glob.clone(), topics, false))
        };
        Ok(AnyMessages {
            scanner: Scanner::open(path.as_ref())?,
            globs: topics.iter().map(glob).collect::<Result<_, LogError>>()?,
            wanted: Vec::new(),
            cut: None,
        })
    }

    /// The next message; none at the end, or where the file is cut.
    ///
    /// # Errors
    /// If the file cannot be read, or is damaged.
    #[expect(
        clippy::should_implement_trait,
        reason = "the message borrows from the reader"
    )]
    pub fn next(&mut self) -> Result<Option<AnyMessage<'_>>, LogError> {
        loop {
            match self.scanner.next()? {
                None => return Ok(None),
                Some(Item::Message(message)) => {
                    if is_wanted(&mut self.wanted, &mut self.globs, message.channel) {
                        break;
                    }
                }
                Some(Item::Damage { offset, what }) => {
                    return Err(LogError::damaged(self.scanner.path(), offset, what));
                }
                Some(Item::Cut { offset, what }) => {
                    self.cut = Some(format!("cut at byte {offset}: {what}"));
                }
                Some(_) => {}
            }
        }
        let channels = self.scanner.channels();
        let message = self.scanner.current();
        Ok(message.map(|message| AnyMessage { message, channels }))
    }

    /// Where the file was cut; none if it was read to its end.
    pub fn cut(&self) -> Option<&str> {
        self.cut.as_deref()
    }

    /// Once all is read: that it has no topic for one of the globs, with the nearest that it has.
    ///
    /// # Errors
    /// [`LogError::NoSuchTopic`].
    pub fn check_topics(&self) -> Result<(), LogError> {
        let Some((glob, ..)) = self.globs.iter().find(|(_, _, found)| !found) else {
            return Ok(());
        };
        let topics = self.scanner.channels().iter();
        // A topic may be declared and have no messages.
        let declared: Vec<&str> = topics.map(|channel| channel.topic.as_str()).collect();
        let matches = Topics::new(std::slice::from_ref(glob))?;
        if declared.iter().any(|topic| matches.matches(topic)) {
            return Ok(());
        }
        let close = nearest(glob, declared.into_iter());
        Err(LogError::NoSuchTopic {
            path: self.scanner.path().to_owned(),
            topic: glob.clone(),
            hint: did_you_mean(close.as_deref()),
        })
    }
}

/// Whether messages on a channel are wanted.
fn is_wanted(
    wanted: &mut Vec<Option<bool>>,
    globs: &mut [(String, Topics, bool)],
    channel: &ChannelInfo,
) -> bool {
    let serial = channel.serial as usize;
    if wanted.len() <= serial {
        wanted.resize(serial + 1, None);
    }
    *wanted[serial].get_or_insert_with(|| {
        let mut any = globs.is_empty();
        for (_, topics, found) in globs {
            let matches = topics.matches(&channel.topic);
            *found |= matches;
            any |= matches;
        }
        any
    })
}
