//! The page of a run that is not finished.

use super::live_run::{LiveRun, LiveState, Phase};
use super::scene::Scene;
use super::{add_scene, page_files, title};
use anyhow::Context;
use command_line::terminal::StopFlag;
use file_server::{Content, Server, Site};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;
use tempfile::TempDir;

/// Names in the site.
const STATE: &str = "live.json";
const POINTS: &str = "live.las";
const PARTS: &str = "live_parts.jsonl";
/// Requesting it once the run is finished ends this site: the site of the finished run follows.
const FINAL: &str = "final.json";
/// Time between two reads of the folder. A submap takes seconds.
const INTERVAL: Duration = Duration::from_millis(500);
/// Time between two checks of whether the viewer ends.
const POLL: Duration = Duration::from_millis(50);

/// Page and points of a run that is not finished.
pub struct LiveSite {
    run: LiveRun,
    site: Site,
    state: Arc<Mutex<LiveState>>,
    wants_final: Arc<AtomicBool>,
    /// Folder of the copied points.
    _folder: TempDir,
}

impl LiveSite {
    /// The site for the run into `output`.
    pub fn new(output: &Path) -> anyhow::Result<Self> {
        let folder = tempfile::tempdir().context("cannot create a temporary folder")?;
        let points = folder.path().join(POINTS);
        let parts = folder.path().join(PARTS);
        let run = LiveRun::new(output, points.clone(), parts.clone())?;
        let mut site = Site::default();
        page_files::add(&mut site);
        site.add(POINTS, Content::File(points));
        site.add(PARTS, Content::File(parts));
        let state = Arc::<Mutex<LiveState>>::default();
        let wants_final = Arc::<AtomicBool>::default();
        let shown = Arc::clone(&state);
        site.add(STATE, Content::OnRequest(Box::new(move || serde_json::to_vec(&*lock(&shown)).ok())));
        let wanted = Arc::clone(&wants_final);
        let shown = Arc::clone(&state);
        let ask = move || {
            let is_finished = lock(&shown).phase == Phase::Finished;
            wanted.fetch_or(is_finished, Ordering::Relaxed);
            is_finished.then(|| b"{}".to_vec())
        };
        site.add(FINAL, Content::OnRequest(Box::new(ask)));
        add_scene(&Scene::live(title(output)), &mut site)?;
        Ok(Self { run, site, state, wants_final, _folder: folder })
    }

    /// Serves until Ctrl-C (false), or until the page has asked for the final cloud (true).
    pub fn serve(mut self, server: &Server, stop: &StopFlag) -> anyhow::Result<bool> {
        let site = &self.site;
        let state = &self.state;
        let wants_final = &self.wants_final;
        let has_failed = AtomicBool::new(false);
        let is_over = || stop.is_set() || wants_final.load(Ordering::Relaxed) || has_failed.load(Ordering::Relaxed);
        let run = &mut self.run;
        thread::scope(|scope| {
            let follow = || {
                let followed = follow(run, state, is_over);
                has_failed.store(followed.is_err(), Ordering::Relaxed);
                followed
            };
            let follower = thread::Builder::new().name("follow".to_owned()).spawn_scoped(scope, follow)?;
            server.run(site, is_over);
            follower.join().map_err(|_| anyhow::anyhow!("the thread that follows the run has panicked"))?
        })?;
        Ok(!stop.is_set())
    }
}

/// Polls the run.
fn follow(run: &mut LiveRun, state: &Mutex<LiveState>, is_over: impl Fn() -> bool) -> anyhow::Result<()> {
    while !is_over() {
        *lock(state) = run.update()?;
        let mut waited = Duration::ZERO;
        while waited < INTERVAL && !is_over() {
            thread::sleep(POLL);
            waited += POLL;
        }
    }
    Ok(())
}

/// Locks the state, which is consistent at any time, even after a panic of another thread.
fn lock(state: &Mutex<LiveState>) -> std::sync::MutexGuard<'_, LiveState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}
