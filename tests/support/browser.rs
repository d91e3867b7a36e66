//! Chromium without a window, driven over the pipe of its debugging protocol.

use serde_json::{Value, json};
use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

/// Chromium with one page. Killed when dropped.
pub struct Browser {
    child: Child,
    commands: RefCell<File>,
    answers: RefCell<BufReader<File>>,
    last_id: Cell<u64>,
    session: String,
    errors: RefCell<Vec<String>>,
    _profile: TempDir,
}

impl Browser {
    /// Opens a page of `width` x `height` px.
    pub fn open(url: &str, [width, height]: [u32; 2]) -> Self {
        let profile = tempfile::tempdir().expect("a folder");
        let [commands, answers] = ["commands", "answers"].map(|name| profile.path().join(name));
        let made = Command::new("mkfifo").args([&commands, &answers]).status().expect("starts");
        assert!(made.success());
        // Chromium reads commands from descriptor 3 and writes answers to 4.
        let child = Command::new("sh")
            .args(["-c", "commands=$1 answers=$2; shift 2; exec chromium \"$@\" 3<\"$commands\" 4>\"$answers\"", "sh"])
            .args([&commands, &answers])
            .args(["--headless", "--no-sandbox", "--no-first-run", "--remote-debugging-pipe"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic"])
            // WebGL on the processor.
            .args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"])
            .arg(format!("--window-size={width},{height}"))
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("starts");
        // Each of these waits for the other side, which opens them in this order.
        let commands = File::options().write(true).open(commands).expect("opens");
        let answers = File::open(answers).expect("opens");
        let mut browser = Self {
            child,
            commands: RefCell::new(commands),
            answers: RefCell::new(BufReader::new(answers)),
            last_id: Cell::new(0),
            session: String::new(),
            errors: RefCell::default(),
            _profile: profile,
        };
        let targets = browser.call("Target.getTargets", &json!({}));
        let targets = targets["targetInfos"].as_array().expect("a list");
        let page = targets.iter().find(|target| target["type"] == "page").expect("a page");
        let attached = browser.call("Target.attachToTarget", &json!({"targetId": page["targetId"], "flatten": true}));
        attached["sessionId"].as_str().expect("a session").clone_into(&mut browser.session);
        let size = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        browser.call("Emulation.setDeviceMetricsOverride", &size);
        for method in ["Runtime.enable", "Log.enable", "Page.enable"] {
            browser.call(method, &json!({}));
        }
        browser.call("Page.navigate", &json!({ "url": url }));
        browser
    }

    /// The value of an expression; promises are awaited.
    pub fn evaluate(&self, expression: &str) -> Value {
        let parameters = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        // A page that is being reloaded does not answer: the next one does.
        let answer = loop {
            match self.try_call("Runtime.evaluate", &parameters) {
                Err(error) if error.to_string().contains("navigated") => {}
                answer => break answer.unwrap_or_else(|error| panic!("{expression}: {error}")),
            }
        };
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Presses and releases the left button at a position of the page, px.
    pub fn click(&self, [x, y]: [f64; 2]) {
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1});
            self.call("Input.dispatchMouseEvent", &event);
        }
    }

    /// Errors of the page and its console so far.
    pub fn errors(&self) -> Vec<String> {
        self.errors.borrow().clone()
    }

    fn call(&self, method: &str, parameters: &Value) -> Value {
        self.try_call(method, parameters).unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    /// Sends a command and waits for its answer.
    fn try_call(&self, method: &str, parameters: &Value) -> Result<Value, Value> {
        let id = self.last_id.get() + 1;
        self.last_id.set(id);
        let mut command = json!({"id": id, "method": method, "params": parameters});
        if !self.session.is_empty() {
            command["sessionId"] = self.session.clone().into();
        }
        self.commands.borrow_mut().write_all(format!("{command}\0").as_bytes()).expect("Chromium runs");
        loop {
            let mut bytes = Vec::new();
            self.answers.borrow_mut().read_until(0, &mut bytes).expect("reads");
            assert!(bytes.pop() == Some(0), "Chromium has ended");
            let message: Value = serde_json::from_slice(&bytes).expect("JSON");
            if message["id"] == id {
                return if message["error"].is_null() {
                    Ok(message["result"].clone())
                } else {
                    Err(message["error"].clone())
                };
            }
            self.note(&message);
        }
    }

    fn note(&self, event: &Value) {
        let parameters = &event["params"];
        let is_error = match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => true,
            Some("Runtime.consoleAPICalled") => parameters["type"] == "error",
            Some("Log.entryAdded") => parameters["entry"]["level"] == "error",
            _ => false,
        };
        if is_error {
            self.errors.borrow_mut().push(parameters.to_string());
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
