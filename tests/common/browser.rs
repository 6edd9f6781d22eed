//! Chromium without a screen, driven by what its driver understands: WebDriver, JSON over HTTP.

#![allow(dead_code)] // Each test binary uses its part of this.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use serde_json::{Value, json};

/// Far longer than any answer takes.
const DEADLINE: Duration = Duration::from_secs(90);

/// A browser with one page. Closed when dropped.
pub struct Browser {
    driver: Child,
    address: String,
    session: String,
}

impl Browser {
    /// Started with these switches; nothing, by name, where there is none.
    pub fn start(switches: &[&str]) -> Option<Self> {
        let mut driver = Command::new("chromedriver");
        driver
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        let Ok(mut driver) = driver.spawn() else {
            eprintln!("skipped: chromedriver is not installed; tests/run installs it where it can");
            return None;
        };
        let mut lines = BufReader::new(driver.stdout.take().expect("piped")).lines();
        let port = lines.find_map(|line| {
            let line = line.expect("text");
            let (_, port) = line.split_once("successfully on port ")?;
            port.trim_end_matches('.').parse::<u16>().ok()
        });
        let mut browser = Self {
            driver,
            address: format!("127.0.0.1:{}", port.expect("a port")),
            session: String::new(),
        };
        let always = ["--headless=new", "--no-sandbox", "--hide-scrollbars"];
        let switches = [&always[..], switches].concat();
        let options = json!({"args": switches});
        let wanted = json!({
            "goog:chromeOptions": options,
            "goog:loggingPrefs": {"browser": "ALL"},
            "timeouts": {"script": 60_000},
        });
        let session = browser.call(
            "POST",
            "",
            &json!({"capabilities": {"alwaysMatch": wanted}}),
        );
        session["sessionId"]
            .as_str()
            .expect("a session")
            .clone_into(&mut browser.session);
        Some(browser)
    }

    pub fn open(&self, url: &str) {
        self.post("/url", &json!({"url": url}));
    }

    /// What a piece of JavaScript returns.
    pub fn ask(&self, script: &str) -> Value {
        self.post("/execute/sync", &json!({"script": script, "args": []}))
    }

    /// Waits until an expression is true.
    pub fn wait(&self, condition: &str) {
        let script = format!(
            "const told = arguments[0];
             const look = () => ({condition}) ? told(true) : requestAnimationFrame(look);
             look();"
        );
        self.post("/execute/async", &json!({"script": script, "args": []}));
    }

    /// Presses keys where the focus is.
    pub fn press(&self, key: char) {
        let keys = [
            json!({"type": "keyDown", "value": key}),
            json!({"type": "keyUp", "value": key}),
        ];
        let actions = json!([{"type": "key", "id": "keyboard", "actions": keys}]);
        self.post("/actions", &json!({"actions": actions}));
    }

    /// Lays as many fingers on the page as there are ways, takes each from its first place to its second, and lifts
    /// them; places are in pixels of the window.
    pub fn touch(&self, ways: &[[[f64; 2]; 2]]) {
        let go = |[x, y]: [f64; 2], ms: u32| json!({"type": "pointerMove", "duration": ms, "x": x.round(), "y": y.round()});
        let finger = |(k, [from, to]): (usize, &[[f64; 2]; 2])| {
            let (begin, end) = (go(*from, 0), go(*to, 100));
            json!({
                "type": "pointer",
                "id": format!("finger{k}"),
                "parameters": {"pointerType": "touch"},
                "actions": [begin, {"type": "pointerDown", "button": 0}, end, {"type": "pointerUp", "button": 0}],
            })
        };
        let fingers: Vec<Value> = ways.iter().enumerate().map(finger).collect();
        self.post("/actions", &json!({"actions": fingers}));
    }

    /// Makes the screen so large, and light or dark.
    pub fn screen(&self, width: u32, height: u32, scheme: &str) {
        let size =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.tell("Emulation.setDeviceMetricsOverride", &size);
        let media = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        self.tell("Emulation.setEmulatedMedia", &media);
    }

    /// At every width, light and dark: nothing is wider than the screen. With `HORMA_PICTURES` set, pictures of all of
    /// it are left in the target folder, to be looked at: they take longer than all else.
    pub fn check_widths(&self, what: &str) {
        let pictures = std::env::var_os("HORMA_PICTURES").is_some();
        for (width, height) in [(1280, 900), (390, 844)] {
            for scheme in ["light", "dark"] {
                self.screen(width, height, scheme);
                let wide = self.ask("return document.documentElement.scrollWidth");
                assert_eq!(wide, json!(width), "{what}, {scheme}");
                if pictures {
                    let file = format!("{what}-{width}-{scheme}.png");
                    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(file);
                    std::fs::write(file, self.picture()).expect("writable");
                }
            }
        }
        self.screen(1280, 900, "light");
    }

    /// A picture of all of the page, as PNG.
    fn picture(&self) -> Vec<u8> {
        self.capture(&json!({"format": "png", "captureBeyondViewport": true}))
    }

    /// A picture of what is on the screen, as JPEG.
    pub fn snapshot(&self) -> Vec<u8> {
        self.capture(&json!({"format": "jpeg", "quality": 80}))
    }

    fn capture(&self, how: &Value) -> Vec<u8> {
        let taken = self.tell("Page.captureScreenshot", how);
        let data = taken["data"].as_str().expect("a picture");
        BASE64_STANDARD.decode(data).expect("base 64")
    }

    /// What the browser complained of.
    pub fn complaints(&self) -> Vec<Value> {
        let log = self.post("/se/log", &json!({"type": "browser"}));
        log.as_array().expect("a list").clone()
    }

    /// Tells Chromium in its own protocol.
    fn tell(&self, command: &str, params: &Value) -> Value {
        self.post(
            "/goog/cdp/execute",
            &json!({"cmd": command, "params": params}),
        )
    }

    fn post(&self, path: &str, body: &Value) -> Value {
        self.call("POST", &format!("/{}{path}", self.session), body)
    }

    fn call(&self, method: &str, path: &str, body: &Value) -> Value {
        let (status, answer) = self
            .request(method, path, body)
            .expect("the driver answers");
        let value = answer["value"].clone();
        assert_eq!(status, "200", "{path} {body}: {value}");
        value
    }

    fn request(&self, method: &str, path: &str, body: &Value) -> std::io::Result<(String, Value)> {
        let mut stream = TcpStream::connect(&self.address)?;
        stream.set_read_timeout(Some(DEADLINE))?;
        let (address, body) = (&self.address, body.to_string());
        let length = body.len();
        write!(
            stream,
            "{method} /session{path} HTTP/1.1\r\nHost: {address}\r\nContent-Length: {length}\r\n\r\n{body}"
        )?;
        // The browser inherits the connection, so that its end does not come with that of the answer.
        let mut answer = BufReader::new(stream);
        let (mut status, mut length) = (String::new(), 0);
        answer.read_line(&mut status)?;
        loop {
            let mut line = String::new();
            answer.read_line(&mut line)?;
            match line.trim_end().split_once(':') {
                Some((name, value)) if name.eq_ignore_ascii_case("content-length") => {
                    length = value.trim().parse().map_err(std::io::Error::other)?;
                }
                Some(_) => {}
                None => break,
            }
        }
        let mut body = vec![0; length];
        answer.read_exact(&mut body)?;
        let status = status.split(' ').nth(1).unwrap_or_default().to_owned();
        Ok((status, serde_json::from_slice(&body)?))
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Without its driver the browser would live on.
        let _ = self.request("DELETE", &format!("/{}", self.session), &json!({}));
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
