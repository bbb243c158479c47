//! Results whose fields say what they are: one documentation for whoever reads the code and for
//! `farside explain`.

/// Declares a struct of results whose fields' documentation is there when the program runs too:
/// `about(field)` gives it, for [`Metric::about`](crate::system::Metric::about), and `keys()` the
/// fields as [`Key`](crate::system::Key)s of a file. A part from `Source:` on says where a field is
/// from.
///
/// ```
/// farside_actors::documented! {
///     /// What came of it.
///     #[derive(Default)]
///     pub struct Counted {
///         /// How many were heard,
///         /// copies not counted.
///         ///
///         /// Source: a paper, section 2.
///         pub heard: u32,
///     }
/// }
/// let (about, source) = Counted::about("heard").unwrap();
/// assert_eq!(about, "How many were heard, copies not counted.");
/// assert_eq!((source.as_str(), Counted::default().heard), ("a paper, section 2.", 0));
/// assert_eq!(Counted::about("herd"), None);
/// assert_eq!((Counted::keys()[0].name, Counted::keys()[0].value), ("heard", "a whole number"));
/// ```
#[macro_export]
macro_rules! documented {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident {
            $(
                $(#[doc = $doc:literal])+
                $(#[serde($($with:tt)+)])?
                $field_vis:vis $field:ident: $type:ty,
            )+
        }
    ) => {
        $(#[$meta])*
        $vis struct $name {
            $(
                $(#[doc = $doc])+
                $(#[serde($($with)+)])?
                $field_vis $field: $type,
            )+
        }

        impl $name {
            /// What a field is, and where it is from (empty if nowhere); none if there is no such
            /// field.
            #[allow(dead_code, reason = "some structs are results, others are files")]
            $vis fn about(field: &str) -> Option<(String, String)> {
                match field {
                    $(stringify!($field) => Some($crate::system::parted(&[$($doc),+])),)+
                    _ => None,
                }
            }

            /// What each field is, in their order.
            #[allow(dead_code, reason = "some structs are results, others are files")]
            $vis fn keys() -> Vec<$crate::system::Key> {
                vec![$(
                    $crate::system::Key::new(stringify!($field), &[$($doc),+])
                        .typed(stringify!($type), ""),
                )+]
            }
        }
    };
}

/// Lines of documentation as what something is and where it is from.
#[doc(hidden)]
pub fn parted(lines: &[&'static str]) -> (String, String) {
    let lines: Vec<&str> = lines.iter().map(|line| line.trim()).collect();
    let joined = lines.join(" ").trim().to_owned();
    match joined.split_once("Source:") {
        None => (joined, String::new()),
        Some((about, source)) => (about.trim().to_owned(), source.trim().to_owned()),
    }
}

/// The metrics of a system with what `about` says of each, where the metric itself says nothing.
/// Called once for a program: what it makes stays.
pub fn with_about(
    metrics: &[super::Metric],
    about: impl Fn(&str) -> Option<(String, String)>,
) -> Vec<super::Metric> {
    let kept = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
    let all = metrics.iter().map(|metric| match about(metric.name) {
        Some((text, source)) if metric.about.is_empty() => {
            metric.about(kept(text)).source(kept(source))
        }
        _ => *metric,
    });
    all.collect()
}
