//! A browser that tests drive: Chromium without a window, over its DevTools protocol. Commands and answers are JSON,
//! each ended by a zero byte, over two pipes that the browser has as its files 3 and 4.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

/// What the browser is called, on this or that system.
const NAMES: [&str; 6] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome-headless-shell",
    "chromium-shell",
];

/// A browser that is installed; where there is none, why a test does nothing.
pub(crate) fn installed() -> Result<PathBuf, &'static str> {
    if cfg!(not(unix)) {
        return Err("the browser is driven over files 3 and 4, which only Unix has");
    }
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&folders)
        .flat_map(|folder| NAMES.map(|name| folder.join(name)))
        .find(|path| path.is_file());
    found.ok_or("no Chromium is installed (Debian: apt-get install chromium)")
}

/// A browser with one page.
pub(crate) struct Browser {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    session: Option<String>,
    last: u64,
    /// What happened on the page that should not have: exceptions, messages of the console, requests.
    pub(crate) complaints: Vec<String>,
    /// What it keeps, and where it is gone with it.
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Starts it with a page of this width, in light or dark.
    pub(crate) fn start(program: &Path, width: u32, scheme: &str) -> Browser {
        let profile = tempfile::tempdir().expect("there is a place for temporary files");
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null"])
            .arg(program)
            .args([
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--no-first-run",
            ])
            .args(["--disable-background-networking", "--remote-debugging-pipe"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("a shell starts it");
        let to = child.stdin.take().expect("it is piped");
        let from = BufReader::new(child.stdout.take().expect("it is piped"));
        let mut browser = Browser {
            child,
            to,
            from,
            session: None,
            last: 0,
            complaints: Vec::new(),
            _profile: profile,
        };
        browser.attach();
        let mobile = width < 600;
        browser.call(
            "Emulation.setDeviceMetricsOverride",
            json!({ "width": width, "height": 900, "deviceScaleFactor": 1, "mobile": mobile }),
        );
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        browser.call(
            "Emulation.setEmulatedMedia",
            json!({ "features": features }),
        );
        browser
    }

    fn attach(&mut self) {
        let targets = self.call("Target.getTargets", json!({}));
        let targets = targets["targetInfos"].as_array().expect("a list").clone();
        let page = targets.iter().find(|target| target["type"] == "page");
        let id = page.expect("there is a page")["targetId"].clone();
        let attach = json!({ "targetId": id, "flatten": true });
        let attached = self.call("Target.attachToTarget", attach);
        self.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            self.call(&format!("{domain}.enable"), json!({}));
        }
    }

    /// Sends a command and waits for what it answers.
    pub(crate) fn call(&mut self, method: &str, params: Value) -> Value {
        self.last += 1;
        let mut command = json!({ "id": self.last, "method": method, "params": params });
        if let Some(session) = &self.session {
            command["sessionId"] = json!(session);
        }
        let mut bytes = command.to_string().into_bytes();
        bytes.push(0);
        self.to.write_all(&bytes).expect("the browser listens");
        self.to.flush().expect("the browser listens");
        loop {
            let mut bytes = Vec::new();
            let count = self
                .from
                .read_until(0, &mut bytes)
                .expect("the browser answers");
            assert!(count > 0, "the browser is gone");
            bytes.pop();
            let mut answer: Value = serde_json::from_slice(&bytes).expect("it answers in JSON");
            if answer["id"] == self.last {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].take();
            }
            self.note(&answer);
        }
    }

    /// Keeps what a page must not do.
    fn note(&mut self, event: &Value) {
        let method = event["method"].as_str().unwrap_or_default();
        let params = &event["params"];
        let address = params["request"]["url"].as_str().unwrap_or_default();
        let loads = method == "Network.requestWillBeSent"
            && !address.starts_with("file:")
            && !address.starts_with("data:");
        let says = [
            "Runtime.exceptionThrown",
            "Log.entryAdded",
            "Runtime.consoleAPICalled",
        ];
        if loads || says.contains(&method) {
            self.complaints.push(format!("{method}: {params}"));
        }
    }

    /// What an expression is on the page.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let call = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let mut answer = self.call("Runtime.evaluate", call);
        let failed = &answer["exceptionDetails"];
        assert!(failed.is_null(), "{expression}: {failed}");
        answer["result"]["value"].take()
    }

    /// Waits until an expression is true.
    pub(crate) fn wait(&mut self, expression: &str) {
        for _ in 0..400 {
            if self.value(expression) == json!(true) {
                return;
            }
            std::thread::sleep(Duration::from_millis(25));
        }
        let said = self.value("document.getElementById('facts')?.textContent");
        panic!(
            "never true: {expression}; the page says {said}, {:?}",
            self.complaints
        );
    }

    /// Opens a file and waits until it says that all of it is drawn.
    pub(crate) fn open(&mut self, page: &Path) {
        let page = page.canonicalize().expect("the page is there");
        let letters = page.display().to_string().replace('%', "%25");
        let letters = letters
            .replace('<', "%3C")
            .replace('#', "%23")
            .replace('?', "%3F");
        self.call(
            "Page.navigate",
            json!({ "url": format!("file://{letters}") }),
        );
        self.wait("document.documentElement?.dataset.ready === 'yes'");
    }

    /// Clicks at a place of the window.
    pub(crate) fn click(&mut self, x: f64, y: f64) {
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", event);
        }
    }

    /// Clicks into the middle of the first element that fits.
    pub(crate) fn click_on(&mut self, selector: &str) {
        let place = self.value(&format!(
            "(() => {{ const e = document.querySelector({selector:?}); \
             e.scrollIntoView({{ block: 'center', behavior: 'instant' }}); const r = e.getBoundingClientRect(); \
             return [r.x + r.width / 2, r.y + r.height / 2]; }})()"
        ));
        self.click(number(&place[0]), number(&place[1]));
    }

    /// Presses a key.
    pub(crate) fn press(&mut self, key: &str) {
        let text = if key.chars().count() == 1 { key } else { "" };
        for kind in ["keyDown", "keyUp"] {
            let event = json!({ "type": kind, "key": key, "text": if kind == "keyDown" { text } else { "" } });
            self.call("Input.dispatchKeyEvent", event);
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}
