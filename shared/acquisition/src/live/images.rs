//! Folders that a grabber fills with images: a thread records each complete file and queues it for publication.
//!
//! The kernel reports a file when its writer closes it or renames it into place (inotify). Therefore a file that is
//! still being written is never taken, and a folder with a day of images costs nothing. Files without an event, because
//! they were written before a restart or the queue of events overflowed, are found by listing the folders.

use super::now;
use super::record_file::{Recorded, record_file};
use crate::error::LiveError;
use drive::{Frame, frame_stamp, is_image_name, is_mosaic_name};
use files::names::sort_by_name;
use geometry::Stamp;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::inotify;
use rustix::io::Errno;
use std::collections::VecDeque;
use std::fs;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// Interval at which the thread checks whether to stop.
const IDLE: Duration = Duration::from_millis(50);
/// Time without changes after which a file without an event counts as complete. A grabber writes an image in
/// milliseconds.
const UNCHANGED: Duration = Duration::from_secs(1);
/// Largest number of images that wait for publication. With more, the decoder is far behind, and the oldest images are
/// left out. They are recorded.
const MAX_WAITING: usize = 4096;
/// Bytes of events read at once: some hundred.
const EVENTS: usize = 16_384;

/// Kind of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CameraKind {
    /// Color camera.
    Color,
    /// Mosaic camera.
    Mosaic,
}

/// A camera whose folder is watched.
#[derive(Clone, Debug)]
pub(super) struct WatchedCamera {
    pub(super) kind: CameraKind,
    /// Index among the cameras of its kind.
    pub(super) index: usize,
    /// Delay of its stamps, ns.
    pub(super) delay_nanos: i64,
    /// Folder in which the grabber writes.
    pub(super) source: PathBuf,
    /// Folder in which the images are recorded.
    pub(super) recorded: PathBuf,
}

/// An image that was recorded.
#[derive(Clone, Debug)]
pub(super) struct ArrivedImage {
    pub(super) kind: CameraKind,
    /// The file in the recording.
    pub(super) frame: Frame,
    /// Time at which its file was complete, if an event reported it.
    pub(super) arrived: Option<Stamp>,
}

/// Numbers of files since the start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ImageCounts {
    /// Recorded images.
    pub(super) recorded: u64,
    /// Images whose name is not a stamp; not recorded.
    pub(super) strange: u64,
    /// Images that could not be read or were removed before they were recorded.
    pub(super) unreadable: u64,
    /// Recorded images that waited too long for publication.
    pub(super) left_out: u64,
}

/// The thread and its queue.
pub(super) struct ImageWatch {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    waiting: VecDeque<ArrivedImage>,
    counts: ImageCounts,
    error: Option<LiveError>,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ImageWatch {
    /// Starts to watch. Files that were last changed before `begin` are not taken. All folders exist.
    pub(super) fn start(cameras: Vec<WatchedCamera>, begin: Stamp) -> Result<Self, LiveError> {
        let watcher = Watcher::new(cameras, begin)?;
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("images".to_owned()).spawn(move || {
            if let Err(error) = watcher.run(&of_thread) {
                of_thread.state().error = Some(error);
            }
        });
        Ok(Self { shared, thread: Some(thread.map_err(LiveError::Thread)?) })
    }

    /// The error that ended the thread, if it failed.
    pub(super) fn take_error(&self) -> Option<LiveError> {
        let has_ended = self.thread.as_ref().is_some_and(JoinHandle::is_finished);
        let panicked = || LiveError::Thread(std::io::Error::other("the thread of the images panicked"));
        has_ended.then(|| self.shared.state().error.take().unwrap_or_else(panicked))
    }

    /// Images recorded since the last call.
    pub(super) fn take(&self) -> VecDeque<ArrivedImage> {
        std::mem::take(&mut self.shared.state().waiting)
    }

    pub(super) fn counts(&self) -> ImageCounts {
        self.shared.state().counts
    }

    /// Ends the thread, which first records the files that are complete.
    pub(super) fn close(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread is on stderr.
            let _ = thread.join();
        }
    }
}

impl Drop for ImageWatch {
    fn drop(&mut self) {
        self.close();
    }
}

struct Watcher {
    events: OwnedFd,
    /// Cameras with the descriptors of their watches.
    cameras: Vec<(i32, WatchedCamera)>,
    begin: Stamp,
    /// Time of the next listing of the folders.
    list_at: Option<Instant>,
}

impl Watcher {
    fn new(cameras: Vec<WatchedCamera>, begin: Stamp) -> Result<Self, LiveError> {
        let watched = |camera: WatchedCamera, events: &OwnedFd| -> Result<(i32, WatchedCamera), LiveError> {
            let flags = inotify::WatchFlags::CLOSE_WRITE | inotify::WatchFlags::MOVED_TO | inotify::WatchFlags::ONLYDIR;
            let fault = |source: Errno| LiveError::Watch { path: camera.source.clone(), source: source.into() };
            let watch = inotify::add_watch(events, &camera.source, flags).map_err(fault)?;
            Ok((watch, camera))
        };
        let events = inotify::init(inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC);
        let events = events.map_err(|error| LiveError::Thread(error.into()))?;
        let cameras = cameras.into_iter().map(|camera| watched(camera, &events)).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { events, cameras, begin, list_at: Some(Instant::now()) })
    }

    fn run(mut self, shared: &Shared) -> Result<(), LiveError> {
        loop {
            let is_stopping = shared.stop.load(Ordering::Relaxed);
            self.take_events(shared, if is_stopping { Duration::ZERO } else { IDLE })?;
            if self.list_at.is_some_and(|at| at <= Instant::now()) {
                self.list(shared)?;
            }
            if is_stopping {
                return Ok(());
            }
        }
    }

    fn take_events(&mut self, shared: &Shared, timeout: Duration) -> Result<(), LiveError> {
        let fault = |error: Errno| LiveError::Thread(error.into());
        let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(timeout.subsec_nanos()) };
        match poll(&mut [PollFd::new(&self.events, PollFlags::IN)], Some(&timeout)) {
            Ok(0) | Err(Errno::INTR) => return Ok(()),
            Ok(_) => {}
            Err(error) => return Err(fault(error)),
        }
        let mut buffer = [MaybeUninit::uninit(); EVENTS];
        let mut reader = inotify::Reader::new(&self.events, &mut buffer);
        loop {
            let event = match reader.next() {
                Ok(event) => event,
                Err(Errno::AGAIN) => return Ok(()),
                Err(Errno::INTR) => continue,
                Err(error) => return Err(fault(error)),
            };
            if event.events().contains(inotify::ReadFlags::QUEUE_OVERFLOW) {
                self.list_at = Some(Instant::now());
            }
            let camera = self.cameras.iter().find(|(watch, _)| *watch == event.wd());
            if let (Some((_, camera)), Some(name)) = (camera, event.file_name()) {
                let path = camera.source.join(std::ffi::OsStr::from_bytes(name.to_bytes()));
                record(camera, &path, Some(now()), shared)?;
            }
        }
    }

    /// Records files that no event reported. Files that may still be written are examined again later.
    fn list(&mut self, shared: &Shared) -> Result<(), LiveError> {
        let now = SystemTime::now();
        let begin = self.begin.0.max(0) as u64;
        let begin = SystemTime::UNIX_EPOCH + Duration::from_nanos(begin);
        let mut has_young = false;
        for (_, camera) in &self.cameras {
            // A folder that was removed has no files.
            let Ok(entries) = fs::read_dir(&camera.source) else { continue };
            let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
            sort_by_name(&mut paths);
            for path in paths {
                if frame_stamp(&path).is_none() || camera.is_recorded(&path) {
                    continue;
                }
                let Some(changed) = fs::metadata(&path).ok().and_then(|metadata| metadata.modified().ok()) else {
                    continue;
                };
                if changed < begin {
                    continue;
                }
                if now.duration_since(changed).is_ok_and(|age| age >= UNCHANGED) {
                    record(camera, &path, None, shared)?;
                } else {
                    has_young |= camera.has(&path);
                }
            }
        }
        self.list_at = has_young.then(|| Instant::now() + UNCHANGED);
        Ok(())
    }
}

impl WatchedCamera {
    /// Whether a file is an image of the camera, by its name.
    fn has(&self, path: &Path) -> bool {
        match self.kind {
            CameraKind::Color => is_image_name(path),
            CameraKind::Mosaic => is_mosaic_name(path),
        }
    }

    fn is_recorded(&self, path: &Path) -> bool {
        path.file_name().is_some_and(|name| self.recorded.join(name).exists())
    }
}

/// Records a complete file and queues it.
fn record(camera: &WatchedCamera, path: &Path, arrived: Option<Stamp>, shared: &Shared) -> Result<(), LiveError> {
    let Some(name) = path.file_name().filter(|_| camera.has(path)) else { return Ok(()) };
    let Some(stamp) = frame_stamp(path).map(|stamp| stamp.plus_nanos(camera.delay_nanos.saturating_neg())) else {
        shared.state().counts.strange += 1;
        return Ok(());
    };
    let target = camera.recorded.join(name);
    let recorded = record_file(path, &target).map_err(|source| LiveError::File { path: target.clone(), source })?;
    let mut state = shared.state();
    match recorded {
        Recorded::New => {
            state.counts.recorded += 1;
            if state.waiting.len() == MAX_WAITING {
                state.waiting.pop_front();
                state.counts.left_out += 1;
            }
            let frame = Frame { stamp, camera: camera.index, path: target };
            state.waiting.push_back(ArrivedImage { kind: camera.kind, frame, arrived });
        }
        // A file that was opened and closed before it was written, or that was written again.
        Recorded::Empty | Recorded::Before => {}
        Recorded::Unreadable => state.counts.unreadable += 1,
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Folders {
        folder: tempfile::TempDir,
    }

    impl Folders {
        fn new() -> Self {
            let folder = tempfile::tempdir().expect("a folder");
            for name in ["grabber", "recording"] {
                fs::create_dir(folder.path().join(name)).expect("makes");
            }
            Self { folder }
        }

        fn source(&self, name: &str) -> PathBuf {
            self.folder.path().join("grabber").join(name)
        }

        fn start(&self, begin: Stamp) -> ImageWatch {
            let source = self.source("");
            let recorded = self.folder.path().join("recording");
            let camera = WatchedCamera { kind: CameraKind::Color, index: 3, delay_nanos: 0, source, recorded };
            ImageWatch::start(vec![camera], begin).expect("starts")
        }

        fn recorded(&self) -> Vec<(String, Vec<u8>)> {
            let entries = fs::read_dir(self.folder.path().join("recording")).expect("lists").flatten();
            let read = |entry: fs::DirEntry| {
                (entry.file_name().to_string_lossy().into_owned(), fs::read(entry.path()).expect("reads"))
            };
            let mut files: Vec<_> = entries.map(read).collect();
            files.sort();
            files
        }
    }

    /// Waits until this number of images has arrived; far longer than any wait on a busy machine.
    fn wait_for(watch: &ImageWatch, n: usize) -> Vec<ArrivedImage> {
        let mut images = Vec::new();
        let deadline = Instant::now() + Duration::from_mins(3);
        while images.len() < n {
            images.extend(watch.take());
            assert!(Instant::now() < deadline, "{images:?}");
            std::thread::yield_now();
        }
        images
    }

    #[test]
    fn only_complete_files_are_taken() {
        let folders = Folders::new();
        fs::write(folders.source("1.jpg"), "before the start").expect("writes");
        let begin = now();
        let old = SystemTime::UNIX_EPOCH + Duration::from_nanos(begin.0 as u64) - Duration::from_secs(9);
        fs::File::options()
            .write(true)
            .open(folders.source("1.jpg"))
            .and_then(|file| file.set_modified(old))
            .expect("sets");
        let mut watch = folders.start(begin);
        // A file that is written in place counts when it is closed, another file when it is renamed.
        let mut written = fs::File::create(folders.source("20.jpg")).expect("creates");
        std::io::Write::write_all(&mut written, b"half").expect("writes");
        fs::write(folders.source(".30.jpg.partial"), "renamed").expect("writes");
        fs::write(folders.source("40.jpg.tmp"), "never renamed").expect("writes");
        fs::write(folders.source("front.jpg"), "no stamp").expect("writes");
        fs::rename(folders.source(".30.jpg.partial"), folders.source("30.jpg")).expect("renames");
        let images = wait_for(&watch, 1);
        assert_eq!((images[0].frame.stamp, images[0].frame.camera), (Stamp(30), 3));
        assert!(images[0].arrived.is_some());
        assert_eq!(folders.recorded(), [("30.jpg".to_owned(), b"renamed".to_vec())]);
        std::io::Write::write_all(&mut written, b" and half").expect("writes");
        drop(written);
        assert_eq!(wait_for(&watch, 1)[0].frame.stamp, Stamp(20));
        watch.close();
        let expected = [("20.jpg".to_owned(), b"half and half".to_vec()), ("30.jpg".to_owned(), b"renamed".to_vec())];
        assert_eq!(folders.recorded(), expected);
        assert_eq!((watch.counts().recorded, watch.counts().strange), (2, 1));
    }

    #[test]
    fn files_written_while_no_process_watched_are_found_by_a_restarted_one() {
        let folders = Folders::new();
        let begin = now();
        let mut first = folders.start(begin);
        fs::write(folders.source("10.jpg"), "a").expect("writes");
        wait_for(&first, 1);
        first.close();
        for (name, age_s) in [("20.jpg", 2), ("30.jpg", 3)] {
            fs::write(folders.source(name), name).expect("writes");
            let changed = SystemTime::now() - Duration::from_secs(age_s);
            let file = fs::File::options().write(true).open(folders.source(name)).expect("opens");
            file.set_modified(changed).expect("sets");
        }
        // The state after a run that began 2.5 s ago.
        let second = folders.start(Stamp(now().0 - 2_500_000_000));
        let images = wait_for(&second, 1);
        assert_eq!((images.len(), images[0].frame.stamp, images[0].arrived), (1, Stamp(20), None));
        let names: Vec<String> = folders.recorded().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["10.jpg", "20.jpg"]);
    }
}
