//! The files that a log holds whole.

use std::path::Path;

use mcap::read::{LinearReader, Options};
use mcap::records::Record;

use crate::{Attachment, LogError};

/// All attachments of a log, in file order: the resolved scenario (`scenario.toml`) and the files
/// that the run read. Of a cut or damaged log, those before the damage.
///
/// ```
/// let error = farside_logs::attachments("no/such/file.mcap").unwrap_err();
/// assert!(error.to_string().contains("no/such/file.mcap"));
/// ```
///
/// # Errors
/// When the file cannot be read, or does not start like an MCAP file.
pub fn attachments(path: impl AsRef<Path>) -> Result<Vec<Attachment>, LogError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|error| LogError::io(path, "read", error))?;
    let reader = LinearReader::new_with_options(&bytes, Options::IgnoreEndMagic.into());
    let reader = reader.map_err(|error| LogError::mcap(path, error))?;
    let records = reader.map_while(Result::ok);
    Ok(records
        .filter_map(|record| match record {
            Record::Attachment { header, data, .. } => Some(Attachment {
                name: header.name,
                media_type: header.media_type,
                bytes: data.into_owned(),
            }),
            _ => None,
        })
        .collect())
}
