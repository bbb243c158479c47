//! A log as systems read it, for pictures and accounts of its run.

use farside_actors::system::{PictureError, Recorded, Recording, RecordingEnd, Seeds};
use farside_logs::{Log, LogError};

/// A log as pictures and accounts read it.
pub(crate) struct Logged<'a> {
    pub(crate) log: &'a Log,
    pub(crate) seeds: Seeds,
}

impl Recording for Logged<'_> {
    fn seeds(&self) -> Seeds {
        self.seeds
    }

    fn scenario(&self) -> &str {
        self.log.scenario_name()
    }

    fn excluded(&self) -> &[String] {
        self.log.exclude()
    }

    fn for_each(
        &self,
        visit: &mut dyn FnMut(&Recorded<'_>) -> Result<(), PictureError>,
    ) -> Result<RecordingEnd, PictureError> {
        let unreadable = |error: LogError| PictureError::Unreadable(error.to_string());
        let mut records = self.log.records().map_err(unreadable)?;
        while let Some((record, _)) = records.next_ref().map_err(unreadable)? {
            visit(&Recorded {
                time_ns: record.key.time_ns,
                class: record.class,
                actor: record.receiver,
                kind: record.kind,
                body: record.body,
            })?;
        }
        let ending = records.ending().end.as_ref();
        let text = |key: &str| ending.and_then(|end| end.get(key));
        Ok(RecordingEnd {
            time_ns: text("end_time_ns").and_then(|text| text.parse().ok()),
            detail: text("end_detail").cloned().unwrap_or_default(),
        })
    }
}
