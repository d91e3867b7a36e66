//! The page of `replica view` in a browser, on the clouds of a run.

use replica_tests::{Browser, SIDE, binary, drive, lidar_pipeline, long_drive, pipeline, wait_for, write_foreign_copc};
use rustix::process::{Signal, kill_process};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// `replica view`, serving. Killed when dropped.
struct Viewer {
    child: Child,
    url: String,
}

impl Viewer {
    /// A viewer of a run or a file.
    fn spawn(path: &Path, options: &[&str]) -> Self {
        let mut child = Command::new(binary("replica"))
            .arg("view")
            .arg(path)
            .args(options)
            .args(["--port", "0"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("is piped")).read_line(&mut line).expect("reads");
        let url = line.split_whitespace().next().expect("an address").to_owned();
        Self { child, url }
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A number of the page.
fn number(browser: &Browser, expression: &str) -> f64 {
    browser.evaluate(expression).as_f64().unwrap_or_else(|| panic!("{expression} is not a number"))
}

/// Pixels that are not the background.
fn drawn_pixels(browser: &Browser) -> f64 {
    let counted = "(() => { const p = __state.pixels(); let n = 0; \
                   for (let i = 0; i < p.length; i += 4) n += p[i] !== 0x14 || p[i + 1] !== 0x17 || p[i + 2] !== 0x1c; return n })()";
    number(browser, counted)
}

/// Sets an input and notifies the page.
fn set(browser: &Browser, id: &str, property: &str, value: &str) {
    browser.evaluate(&format!(
        "(() => {{ const e = document.getElementById('{id}'); e.{property} = {value}; \
         e.dispatchEvent(new Event('input', {{ bubbles: true }})) }})()"
    ));
}

/// Waits until everything in the view is loaded.
fn wait_for_points(browser: &Browser) {
    wait_for("a complete picture", || {
        let is_complete = "!!window.__state && __state.nodes.nLoaded > 0 && __state.nodes.nMissing === 0";
        (browser.evaluate(is_complete) == true).then_some(())
    });
}

#[test]
#[cfg_attr(not(chromium), ignore = "needs Chromium: apt-get install chromium")]
fn browser_draws_hides_and_picks_points() {
    let launch = pipeline(&drive(), "report = false", "").with("--set").with("colorize.materials=true");
    assert_eq!(launch.run().status.code(), Some(0));
    let viewer = Viewer::spawn(&launch.output(), &["--bands"]);
    let browser = Browser::open(&viewer.url, [900, 600]);
    wait_for_points(&browser);
    let n_points = launch.summary()["total"]["points"].as_f64().expect("a number");
    assert_eq!(number(&browser, "__state.cloud.nPoints"), n_points);
    let n_drawn = number(&browser, "__state.nodes.nDrawn");
    assert!(n_drawn > 10_000.0 && n_drawn <= n_points, "{n_drawn} of {n_points}");
    let pixels = drawn_pixels(&browser);
    assert!(pixels > 20_000.0, "{pixels} pixels of 540 000");

    // The budget is respected.
    set(&browser, "budget", "value", "0.1");
    drawn_pixels(&browser);
    let n_within = number(&browser, "__state.nodes.nDrawn");
    assert!(n_within > 0.0 && n_within <= 100_000.0, "{n_within}");
    set(&browser, "budget", "value", "3");

    // Without classes and path nothing is left.
    set(&browser, "path", "checked", "false");
    browser.evaluate("document.getElementById('noClasses').click()");
    assert_eq!(drawn_pixels(&browser), 0.0);
    browser.evaluate("document.getElementById('allClasses').click()");
    assert!(drawn_pixels(&browser) > 0.9 * pixels - 2000.0);
    let legend = browser.evaluate("document.getElementById('classes').innerText");
    assert!(legend.as_str().is_some_and(|text| text.contains("ground") && text.contains("unlabeled")), "{legend}");

    picks_point(&browser);
    let text = browser.evaluate("document.getElementById('point').innerText");
    let fields = ["class", "score", "instance"];
    assert!(text.as_str().is_some_and(|text| fields.iter().all(|field| text.contains(field))), "{text}");
    measures_distance(&browser);

    // Every color mode draws, and the address keeps the view.
    let modes = browser.evaluate("[...document.getElementById('mode').options].map(option => option.value)");
    let modes: Vec<&str> = modes.as_array().expect("a list").iter().filter_map(|mode| mode.as_str()).collect();
    let all = "rgb intensity class instance height time moving score band bands material material_score";
    assert_eq!(modes.join(" "), all);
    for mode in modes {
        set(&browser, "mode", "value", &format!("'{mode}'"));
        assert!(drawn_pixels(&browser) > 0.5 * pixels, "{mode}");
    }
    set(&browser, "mode", "value", "'material'");
    let legend = browser.evaluate("document.getElementById('materials').innerText");
    assert!(legend.as_str().is_some_and(|text| text.contains("unknown") && text.contains("vegetation")), "{legend}");
    wait_for("an address with the mode", || {
        browser.evaluate("location.hash").as_str().is_some_and(|hash| hash.contains("mode=material")).then_some(())
    });

    let resources = browser.evaluate("performance.getEntriesByType('resource').map(entry => entry.name)");
    let foreign = resources.as_array().expect("a list").iter().filter(|name| !name.to_string().contains(&viewer.url));
    assert_eq!(foreign.count(), 0, "{resources}");
    assert_eq!(browser.errors(), Vec::<String>::new());
}

#[test]
#[cfg_attr(not(chromium), ignore = "needs Chromium: apt-get install chromium")]
fn live_page_shows_submaps_while_they_are_written_and_then_the_final_cloud() {
    let launch = lidar_pipeline(&long_drive(), "report = false");
    let viewer = Viewer::spawn(&launch.output(), &["--live"]);
    let browser = Browser::open(&viewer.url, [900, 600]);
    let phase = || browser.evaluate("document.getElementById('phase')?.textContent ?? ''").to_string();
    wait_for("a page without a run", || phase().contains("No run is active").then_some(()));
    browser.evaluate("window.__isFirstPage = true");

    // A source that is stopped early keeps the run from ending before the page has read it.
    let running = launch.start();
    wait_for("a submap", || launch.output().join("clouds/submap_0000.ply").exists().then_some(()));
    let source = running.stage("acquire");
    kill_process(source, Signal::STOP).expect("it lives");
    wait_for_points(&browser);
    assert!(phase().contains("is active"), "{}", phase());
    let n_first = number(&browser, "__state.nodes.nDrawn");
    let pixels = drawn_pixels(&browser);
    assert!(n_first > 1000.0 && pixels > 1000.0, "{n_first} points on {pixels} pixels");
    assert!(number(&browser, "__state.cloud.path.length") > 5.0);
    // Unfinished submaps still move a camera that follows, also between a click and its point.
    set(&browser, "follow", "checked", "false");
    picks_point(&browser);
    // The budget thins all parts.
    set(&browser, "budget", "value", "0.1");
    drawn_pixels(&browser);
    assert!(number(&browser, "__state.nodes.nDrawn") < 101_000.0);
    set(&browser, "budget", "value", "3");

    kill_process(source, Signal::CONT).expect("it lives");
    wait_for("more points", || (number(&browser, "__state.cloud.nPoints") > n_first).then_some(()));
    assert_eq!(running.wait(), Some(0));
    wait_for("the end of the run", || phase().contains("has ended: done").then_some(()));
    assert!(phase().contains("before the poses were corrected"), "{}", phase());
    assert_eq!(browser.evaluate("window.__isFirstPage"), true, "the page was not loaded anew");
    let n_live = number(&browser, "__state.cloud.nPoints");

    browser.evaluate("document.getElementById('final').click()");
    let is_final = "window.__isFirstPage === undefined && !!window.__state";
    wait_for("the final cloud", || (browser.evaluate(is_final) == true).then_some(()));
    wait_for_points(&browser);
    let n_points = launch.summary()["total"]["points"].as_f64().expect("a number");
    assert_eq!(number(&browser, "__state.cloud.nPoints"), n_points);
    assert!(n_live > 0.0 && n_live <= n_points, "{n_live} of {n_points}");
    assert_eq!(browser.evaluate("document.getElementById('live').hidden"), true);
    assert_eq!(browser.errors(), Vec::<String>::new());
}

#[test]
#[cfg_attr(not(chromium), ignore = "needs Chromium: apt-get install chromium")]
fn files_of_other_programs_are_drawn_in_all_point_formats() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("foreign.copc.laz");
    let red = [u16::MAX, 0, 0];
    let black = [0; 3];
    for (format, rgb, mode) in [(6, black, "height"), (7, red, "rgb"), (8, red, "rgb"), (8, black, "height")] {
        write_foreign_copc(&path, format, rgb);
        let viewer = Viewer::spawn(&path, &[]);
        let browser = Browser::open(&viewer.url, [600, 400]);
        wait_for_points(&browser);
        let n_points = (SIDE * SIDE) as f64;
        assert_eq!(number(&browser, "__state.cloud.nPoints"), n_points);
        drawn_pixels(&browser);
        assert_eq!(number(&browser, "__state.nodes.nDrawn"), n_points, "format {format}");
        assert_eq!(browser.evaluate("document.getElementById('mode').value"), mode, "format {format}");
        if rgb == red {
            let is_red = "(() => { const p = __state.pixels(); let n = 0; \
                          for (let i = 0; i < p.length; i += 4) n += p[i] > 60 && p[i + 1] < 20; return n })()";
            assert!(number(&browser, is_red) > 1000.0, "format {format}");
        }
        let legend = browser.evaluate("document.getElementById('classes').innerText");
        let legend = legend.as_str().expect("text");
        assert!(legend.contains("ground") && legend.contains("building") && legend.contains("5 000"), "{legend}");
        click_point(&browser, 0.5);
        let point = browser.evaluate("document.getElementById('point').innerText");
        assert!(point.as_str().is_some_and(|text| text.contains("classification")), "{point}");
        assert_eq!(browser.errors(), Vec::<String>::new());
    }
}

/// Clicks a drawn pixel near the middle: the panel shows its point.
fn picks_point(browser: &Browser) {
    click_point(browser, 0.5);
    let text = browser.evaluate("document.getElementById('point').innerText");
    let text = text.as_str().expect("text");
    for field in ["intensity", "laser", "moving", "frame", "GPS time"] {
        assert!(text.contains(field), "{field}: {text}");
    }
    let value = |name: &str| -> f64 {
        let line = text.lines().find_map(|line| line.strip_prefix(&format!("{name}\t"))).expect(name);
        line.parse().expect(name)
    };
    let place = browser.evaluate(&format!("__state.placeOf([{}, {}, {}])", value("x"), value("y"), value("z")));
    let clicked = browser.evaluate("__clicked");
    for axis in 0..2 {
        let off = (place[axis].as_f64().expect("a number") - clicked[axis].as_f64().expect("a number")).abs();
        assert!(off < 8.0, "the point is at {place}, the click was at {clicked}");
    }
}

fn measures_distance(browser: &Browser) {
    browser.evaluate("document.getElementById('measure').click()");
    click_point(browser, 0.4);
    click_point(browser, 0.6);
    let length = number(browser, "__state.measurement.lengths()[0]");
    assert!(length > 0.01, "{length} m");
    let text = browser.evaluate("document.getElementById('measured').textContent");
    assert!(text.as_str().is_some_and(|text| text.contains(&format!("{length:.3} m"))), "{text}");
    browser.evaluate("document.getElementById('measure').click()");
}

/// Clicks the drawn pixel closest to the middle of the page at a share of its width, and waits for the point.
fn click_point(browser: &Browser, share: f64) {
    let n_before = number(browser, "__state.nClicked");
    let found = browser.evaluate(&format!(
        "(() => {{ const p = __state.pixels(), w = innerWidth, h = innerHeight; let best = null, least = Infinity; \
         for (let i = 0; i < w * h; i++) {{ const x = i % w, y = h - 1 - Math.floor(i / w); \
         const d = (x - {share} * w) ** 2 + (y - h / 2) ** 2; \
         if (d < least && (p[4 * i] !== 0x14 || p[4 * i + 1] !== 0x17 || p[4 * i + 2] !== 0x1c)) [best, least] = [[x, y], d] }} \
         return window.__clicked = best }})()"
    ));
    let place = [0, 1].map(|axis| found[axis].as_f64().expect("a drawn pixel") + 0.5);
    browser.click(place);
    wait_for("the point that was clicked", || (number(browser, "__state.nClicked") > n_before).then_some(()));
}
