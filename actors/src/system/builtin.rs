//! Scenarios and studies that a system brings with it.

/// A scenario or study that is built in.
///
/// ```
/// use farside_actors::system::Builtin;
/// let all = [Builtin { name: "moon/quiet", text: "system = 'moon'" }];
/// assert_eq!(Builtin::find(&all, "moon/quiet").unwrap().text, "system = 'moon'");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Builtin {
    /// The name by which commands find it: `network/crater-dense`.
    pub name: &'static str,
    /// Its text, in TOML.
    pub text: &'static str,
}

impl Builtin {
    /// The one called `name`.
    pub fn find<'a>(all: &'a [Builtin], name: &str) -> Option<&'a Builtin> {
        all.iter().find(|known| known.name == name)
    }
}
