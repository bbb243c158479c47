//! What is wrong with settings.

use thiserror::Error;

use crate::link::LinkConfigError;

/// Settings that cannot be.
#[derive(Debug, Error)]
pub enum SetupError {
    /// Links or degradations.
    #[error(transparent)]
    Links(#[from] LinkConfigError),
    /// A value of the system's own.
    #[error("{key}: {message}")]
    Value {
        /// The dotted key.
        key: String,
        /// What was found and what was expected.
        message: String,
    },
}

impl SetupError {
    /// A value that cannot be, by its dotted key.
    ///
    /// ```
    /// use farside_actors::system::SetupError;
    /// let error = SetupError::value("team.rovers", "0: expected at least 1");
    /// assert_eq!(error.to_string(), "team.rovers: 0: expected at least 1");
    /// ```
    pub fn value(key: &str, message: impl ToString) -> Self {
        SetupError::Value {
            key: key.to_owned(),
            message: message.to_string(),
        }
    }

    /// The key, part by part, and the message.
    pub fn into_parts(self) -> (Vec<String>, String) {
        match self {
            SetupError::Links(error) => (error.key().to_vec(), error.to_string()),
            SetupError::Value { key, message } => {
                (key.split('.').map(str::to_owned).collect(), message)
            }
        }
    }
}
