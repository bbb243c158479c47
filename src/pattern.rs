//! Patterns over names and topics, as shells have them. Not what a pattern is for: scenarios, logs
//! and commands say which names they mean by it.

use std::borrow::Cow;

/// Stands for `/` where that is a character like others; in no name, since names are `snake_case`.
const SLASH: &str = "\u{1}";

/// A pattern: `?` is any character, `*` any number of them, `[a-c]` one of these, `[!a-c]` any
/// other, `{ab,c*}` one of these patterns; what follows a `\` stands for itself. At most ten `{}`.
///
/// ```
/// use farside::Pattern;
/// let some = Pattern::over_names("rover_{1,2}*")?;
/// assert!(some.matches("rover_12") && some.matches("rover_1/arm") && !some.matches("rover_3"));
/// # Ok::<(), farside::BadPattern>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    glob: String,
    levels: bool,
}

/// Why a text is no pattern.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct BadPattern(fast_glob::Error);

impl Pattern {
    /// A pattern over names, in which `/` is a character like others.
    pub fn over_names(text: &str) -> Result<Pattern, BadPattern> {
        Pattern::new(text, false)
    }

    /// A pattern over topics: `?`, `*` and `[]` stay within a level, and `**` is any number of
    /// levels.
    ///
    /// ```
    /// use farside::Pattern;
    /// let lost = Pattern::over_topics("/lost/**/odometry")?;
    /// assert!(lost.matches("/lost/rover_1/odometry") && lost.matches("/lost/odometry"));
    /// assert!(!Pattern::over_topics("/*")?.matches("/lost/odometry"));
    /// # Ok::<(), farside::BadPattern>(())
    /// ```
    pub fn over_topics(text: &str) -> Result<Pattern, BadPattern> {
        Pattern::new(text, true)
    }

    fn new(text: &str, levels: bool) -> Result<Pattern, BadPattern> {
        fast_glob::validate(text).map_err(BadPattern)?;
        // A `!` at the start would mean all that the rest does not match.
        let escape = if text.starts_with('!') { "\\" } else { "" };
        let glob = match levels {
            true => text.to_owned(),
            false => text.replace('/', SLASH),
        };
        let glob = format!("{escape}{glob}");
        Ok(Pattern { glob, levels })
    }

    /// Whether it means this name or topic.
    pub fn matches(&self, name: &str) -> bool {
        let name = match self.levels || !name.contains('/') {
            true => Cow::Borrowed(name),
            false => Cow::Owned(name.replace('/', SLASH)),
        };
        fast_glob::glob_match(&self.glob, &*name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(pattern: Pattern, yes: &[&str], no: &[&str]) {
        for name in yes {
            assert!(pattern.matches(name), "{pattern:?} is to match {name:?}");
        }
        for name in no {
            assert!(
                !pattern.matches(name),
                "{pattern:?} is not to match {name:?}"
            );
        }
    }

    #[test]
    fn names_have_no_levels() {
        let over = |text| Pattern::over_names(text).unwrap();
        check(over("*"), &["a", "a/b", ""], &[]);
        check(over("**"), &["a", "a/b/c"], &[]);
        check(
            over("rover_*"),
            &["rover_1", "rover_1/arm"],
            &["rover", "team/rover_1"],
        );
        check(over("*/arm"), &["a/arm", "a/b/arm"], &["arm", "a/arm_2"]);
        check(
            over("team/*"),
            &["team/a", "team/a/b"],
            &["team", "teams/a"],
        );
        check(over("n?"), &["n1", "n/"], &["n", "n12"]);
        check(over("a-*-b"), &["a-1-b", "a--b"], &["a-b"]);
        check(
            over("*_0[1-3]"),
            &["node_01", "node_03"],
            &["node_04", "node_1"],
        );
        check(over("[!ab]*"), &["c", "ca", "/"], &["a", "bc", ""]);
        check(
            over("{rover,node}_{1,2?}"),
            &["rover_1", "node_25"],
            &["node_2", "rover_12"],
        );
        check(over("{a,b{c,d}}"), &["a", "bc", "bd"], &["b", "ac"]);
        check(over(r"\*"), &["*"], &["a"]);
        check(over("!a"), &["!a"], &["b", "a"]);
    }

    #[test]
    fn topics_have_levels() {
        let over = |text| Pattern::over_topics(text).unwrap();
        check(over("/*/ask"), &["/a/ask"], &["/lost/a/ask", "/a/b"]);
        check(
            over("/lost/**"),
            &["/lost/a/b", "/lost/a"],
            &["/lose/a", "/lost"],
        );
        check(over("**/ask"), &["/a/ask", "/lost/a/b/ask"], &["/a/asks"]);
        check(over("**"), &["/a/ask", "x"], &[]);
        check(over("/a?b"), &["/a_b"], &["/a/b"]);
        check(over("/a[!c]b"), &["/a_b"], &["/a/b"]);
        check(over("/{timer,state}/*/*"), &["/timer/a/b"], &["/event/a/b"]);
    }

    #[test]
    fn what_cannot_be_read_says_where() {
        for (text, says) in [
            ("a[b", "unclosed character class at byte 1"),
            ("{a,b", "unclosed brace expansion at byte 0"),
            ("a\\", "trailing backslash at byte 1"),
        ] {
            let error = Pattern::over_names(text).unwrap_err().to_string();
            assert!(error.starts_with(says), "{error}");
            assert!(Pattern::over_topics(text).is_err());
        }
    }
}
