//! Pages of logs.

use serde_json::json;

use super::{Side, columns, markup};

/// What would end a script or begin one, if it were taken for markup.
const HOSTILE: &str = "</script></title><script>window.hacked=1</script><!--\"'&amp;";

fn hostile() -> Side {
    let text = columns::block(HOSTILE.as_bytes());
    Side {
        head: json!({ "file": HOSTILE, "notes": [HOSTILE], "told": { "names": [HOSTILE] } }),
        rows: text.clone(),
        map: text.clone(),
        series: text.clone(),
        details: text,
        shown: 0,
        left_out: 0,
        notes: Vec::new(),
    }
}

#[test]
fn nothing_that_a_log_says_is_taken_for_markup() {
    let side = hostile();
    let plain = markup::page("plain", &[&side, &side], &json!({ "file_a": HOSTILE }));
    let page = markup::page(HOSTILE, &[&side, &side], &json!({ "file_a": HOSTILE }));
    let count = |page: &str, tag: &str| page.matches(tag).count();
    for tag in [
        "<script",
        "</script",
        "<title",
        "</title",
        "<!--",
        "<style",
        "<noscript",
    ] {
        assert_eq!(count(&page, tag), count(&plain, tag), "{tag}");
    }
    assert!(!page.contains("window.hacked=1</script>"));
    // A head, four blocks a side, and the scripts.
    assert_eq!(count(&page, "<script"), 10);
    assert!(
        page.contains("&lt;/script&gt;"),
        "the title says it as text"
    );
}

#[test]
fn the_page_names_nothing_that_could_be_loaded() {
    let side = hostile();
    let page = markup::page("plain", &[&side], &json!(null));
    for loads in [
        "src=",
        "@import",
        "url(",
        "fetch(",
        "XMLHttpRequest",
        "import(",
        "WebSocket",
    ] {
        assert!(!page.contains(loads), "{loads}");
    }
    let links: Vec<&str> = page
        .split("href=\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    assert_eq!(links, ["data:,"]);
    // One name of a standard and no address.
    assert_eq!(
        page.matches("http").count(),
        page.matches("http-equiv").count() + page.matches("http://www.w3.org/2000/svg").count()
    );
}

#[test]
fn scripts_end_no_script_and_make_no_markup_of_texts() {
    for script in markup::SCRIPTS {
        for wrong in [
            "</",
            "innerHTML",
            "outerHTML",
            "insertAdjacentHTML",
            "document.write",
            "eval(",
        ] {
            assert!(!script.contains(wrong), "{wrong}");
        }
    }
}
