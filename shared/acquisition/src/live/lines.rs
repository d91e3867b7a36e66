//! Lines of a GNSS receiver or an IMU: a thread appends received bytes to a log of the recording; the decoder reads the
//! growing log.
//!
//! Therefore the log contains the received lines even if the process is killed, and a run on the recording reads the
//! same lines.

use super::line_address::{LineAddress, Link};
use super::now;
use geometry::Stamp;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Interval at which the thread checks whether to stop.
const IDLE: Duration = Duration::from_millis(50);
/// Interval at which a lost port is opened again: plugging a cable back in takes seconds.
const REOPEN: Duration = Duration::from_secs(1);
/// The largest UDP packet, and the largest read.
const CHUNK: usize = 65_536;
/// Largest number of reads after the request to stop: empties the kernel's buffer, however fast the sender is.
const MAX_LAST_READS: usize = 4096;
/// Longest line that is decoded, bytes; the rest of a longer one is skipped. NMEA sentences have 82, seven numbers less than 200, and
/// binary messages of a receiver, which end no line, a few thousand.
const MAX_LINE: usize = 8192;
/// Largest number of arrival times that wait for the decoder. Beyond it the oldest are dropped, and fewer lines measure
/// the clock.
const MAX_ARRIVALS: usize = 4096;

/// The log, its thread and the position of the decoder.
pub(super) struct LineLog {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    lines: LineFile,
}

#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    n_interruptions: AtomicU64,
    arrivals: Mutex<VecDeque<Arrival>>,
    error: Mutex<Option<io::Error>>,
}

/// A time, and the size of the log that had arrived by then.
#[derive(Clone, Copy)]
struct Arrival {
    size: u64,
    at: Stamp,
}

/// A line without its end.
pub(super) struct Line {
    pub(super) text: Vec<u8>,
    /// Time at which its end arrived, if known.
    pub(super) arrived: Option<Stamp>,
}

impl LineLog {
    /// Starts to append to the log at `path`. Lines of an earlier process in it are not decoded.
    pub(super) fn start(address: &LineAddress, link: Link, path: &Path) -> io::Result<Self> {
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(path)?;
        let size = end_line(&mut file)?;
        let lines = LineFile::at(path, size)?;
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        let address = address.clone();
        let thread = std::thread::Builder::new().name("lines".to_owned()).spawn(move || {
            if let Err(error) = receive(Some(link), &address, &mut file, size, &of_thread) {
                *of_thread.error.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
        })?;
        Ok(Self { shared, thread: Some(thread), lines })
    }

    /// The error that ended the thread, if it failed.
    pub(super) fn take_error(&self) -> Option<io::Error> {
        let has_ended = self.thread.as_ref().is_some_and(JoinHandle::is_finished);
        let error = self.shared.error.lock().unwrap_or_else(PoisonError::into_inner).take();
        has_ended.then(|| error.unwrap_or_else(|| io::Error::other("the thread of the lines panicked")))
    }

    /// Number of times the port was lost.
    pub(super) fn n_interruptions(&self) -> u64 {
        self.shared.n_interruptions.load(Ordering::Relaxed)
    }

    /// The next complete line; after [`LineLog::close`] also the last one without an end.
    pub(super) fn next_line(&mut self) -> io::Result<Option<Line>> {
        let Some(FileLine { text, end }) = self.lines.next_line(self.thread.is_none())? else { return Ok(None) };
        let mut arrivals = self.shared.arrivals.lock().unwrap_or_else(PoisonError::into_inner);
        while arrivals.front().is_some_and(|arrival| arrival.size < end) {
            arrivals.pop_front();
        }
        Ok(Some(Line { text, arrived: arrivals.front().map(|arrival| arrival.at) }))
    }

    /// Ends the thread, which first reads the rest of the kernel's buffer. Then the log is complete.
    pub(super) fn close(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread is on stderr.
            let _ = thread.join();
        }
    }
}

impl Drop for LineLog {
    fn drop(&mut self) {
        self.close();
    }
}

/// Ends the line that a killed process left, so that the next line starts at the start of a line. Returns the size.
fn end_line(file: &mut File) -> io::Result<u64> {
    let size = file.seek(SeekFrom::End(0))?;
    if size == 0 {
        return Ok(0);
    }
    file.seek(SeekFrom::End(-1))?;
    let mut last = [0];
    file.read_exact(&mut last)?;
    if last == *b"\n" {
        return Ok(size);
    }
    file.write_all(b"\n")?;
    Ok(size + 1)
}

fn receive(
    mut link: Option<Link>,
    address: &LineAddress,
    file: &mut File,
    mut size: u64,
    shared: &Shared,
) -> io::Result<()> {
    let mut buffer = vec![0; CHUNK + 1];
    let mut reopen_at = Instant::now();
    let mut n_last_reads = 0;
    while n_last_reads < MAX_LAST_READS {
        let is_stopping = shared.stop.load(Ordering::Relaxed);
        n_last_reads += usize::from(is_stopping);
        let Some(open) = &mut link else {
            if is_stopping {
                return Ok(());
            }
            std::thread::sleep(IDLE);
            if Instant::now() >= reopen_at {
                link = address.open().ok();
                reopen_at = Instant::now() + REOPEN;
            }
            continue;
        };
        if !open.wait(if is_stopping { Duration::ZERO } else { IDLE })? {
            if is_stopping {
                return Ok(());
            }
            continue;
        }
        let n = match open.read(&mut buffer[..CHUNK]) {
            Ok(Some(n)) => n,
            Ok(None) => continue,
            // A cable was unplugged, or the network is down. The LiDAR continues.
            Err(_) => {
                shared.n_interruptions.fetch_add(1, Ordering::Relaxed);
                link = None;
                reopen_at = Instant::now() + REOPEN;
                continue;
            }
        };
        let arrived = now();
        // A packet also ends a line.
        let is_packet = matches!(open, Link::Udp(_));
        let n = if is_packet && n > 0 && buffer[n - 1] != b'\n' {
            buffer[n] = b'\n';
            n + 1
        } else {
            n
        };
        file.write_all(&buffer[..n])?;
        size += n as u64;
        let mut arrivals = shared.arrivals.lock().unwrap_or_else(PoisonError::into_inner);
        if arrivals.len() == MAX_ARRIVALS {
            arrivals.pop_front();
        }
        arrivals.push_back(Arrival { size, at: arrived });
    }
    Ok(())
}

impl Link {
    /// Waits for data, or for the loss of the port.
    fn wait(&self, timeout: Duration) -> io::Result<bool> {
        let mut descriptors = [match self {
            Self::Udp(socket) => PollFd::new(socket, PollFlags::IN),
            Self::Serial(port) => PollFd::new(port, PollFlags::IN),
        }];
        let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(timeout.subsec_nanos()) };
        match poll(&mut descriptors, Some(&timeout)) {
            Ok(_) => Ok(!descriptors[0].revents().is_empty()),
            Err(rustix::io::Errno::INTR) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Number of bytes read; `None` if no bytes wait. Fails if the port is lost.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<Option<usize>> {
        let read = match self {
            Self::Udp(socket) => socket.recv(buffer),
            Self::Serial(port) => port.read(buffer).and_then(|n| match n {
                0 => Err(io::ErrorKind::UnexpectedEof.into()),
                n => Ok(n),
            }),
        };
        match read {
            Ok(n) => Ok(Some(n)),
            Err(error) if [io::ErrorKind::WouldBlock, io::ErrorKind::Interrupted].contains(&error.kind()) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// Reads complete lines of a growing file in bounded memory.
struct LineFile {
    file: File,
    /// Bytes that were read; the bytes before `begin` have been passed on.
    buffer: Vec<u8>,
    begin: usize,
    /// Offset of the end of the buffer.
    offset: u64,
    /// Whether the start of the buffer is the rest of a line that was too long.
    is_rest: bool,
}

/// A line of a file.
struct FileLine {
    text: Vec<u8>,
    /// Offset of its end.
    end: u64,
}

impl LineFile {
    fn at(path: &Path, offset: u64) -> io::Result<Self> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(offset))?;
        Ok(Self { file, buffer: Vec::new(), begin: 0, offset, is_rest: false })
    }

    /// The next line. `is_complete`: the file does not grow.
    fn next_line(&mut self, is_complete: bool) -> io::Result<Option<FileLine>> {
        loop {
            let rest = &self.buffer[self.begin..];
            if let Some(length) = rest.iter().position(|byte| *byte == b'\n') {
                let text = rest[..length.min(MAX_LINE)].to_vec();
                self.begin += length + 1;
                if std::mem::take(&mut self.is_rest) {
                    continue;
                }
                let end = self.offset - (self.buffer.len() - self.begin) as u64;
                return Ok(Some(FileLine { text, end }));
            }
            if self.is_rest {
                self.begin = self.buffer.len();
            } else if rest.len() >= MAX_LINE {
                let text = rest[..MAX_LINE].to_vec();
                self.begin = self.buffer.len();
                self.is_rest = true;
                return Ok(Some(FileLine { text, end: self.offset }));
            }
            self.buffer.drain(..self.begin);
            self.begin = 0;
            let n = (&mut self.file).take(CHUNK as u64).read_to_end(&mut self.buffer)?;
            self.offset += n as u64;
            if n == 0 {
                let is_last = is_complete && !self.buffer.is_empty();
                return Ok(is_last.then(|| FileLine { text: std::mem::take(&mut self.buffer), end: self.offset }));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use std::net::UdpSocket;

    /// Waits until `next` returns a value; far longer than any wait on a busy machine.
    fn wait_for<T>(mut next: impl FnMut() -> Option<T>) -> T {
        let deadline = Instant::now() + Duration::from_mins(3);
        loop {
            if let Some(found) = next() {
                return found;
            }
            assert!(Instant::now() < deadline, "nothing arrives");
            std::thread::yield_now();
        }
    }

    fn next(log: &mut LineLog) -> String {
        let line = wait_for(|| log.next_line().expect("reads"));
        assert!(line.arrived.is_some());
        String::from_utf8(line.text).expect("is text")
    }

    fn start(address: &str, path: &Path) -> LineLog {
        let address: LineAddress = address.parse().expect("is one");
        LineLog::start(&address, address.open().expect("opens"), path).expect("starts")
    }

    #[test]
    fn packets_are_logged_before_they_are_decoded_and_end_their_lines() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("gnss.nmea");
        std::fs::write(&path, "$cut by a ki").expect("writes");
        let port = UdpSocket::bind("127.0.0.1:0").expect("binds").local_addr().expect("is bound").port();
        let mut log = start(&format!("udp://127.0.0.1:{port}"), &path);
        let sender = UdpSocket::bind("127.0.0.1:0").expect("binds");
        let long = "x".repeat(3 * MAX_LINE);
        for packet in ["$one\r\n$two\r\n", "$three", &long, "$four\r\n"] {
            sender.send_to(packet.as_bytes(), ("127.0.0.1", port)).expect("sends");
        }
        assert_eq!([next(&mut log), next(&mut log), next(&mut log)], ["$one\r", "$two\r", "$three"]);
        assert_eq!(next(&mut log), "x".repeat(MAX_LINE));
        assert_eq!(next(&mut log), "$four\r");
        sender.send_to(b"$last", ("127.0.0.1", port)).expect("sends");
        log.close();
        assert_eq!(next(&mut log), "$last");
        assert!(log.next_line().expect("reads").is_none());
        let expected = format!("$cut by a ki\n$one\r\n$two\r\n$three\n{long}\n$four\r\n$last\n");
        assert_eq!(std::fs::read_to_string(&path).expect("reads"), expected);
    }

    #[test]
    fn serial_port_gives_raw_lines_and_its_loss_is_counted() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("imu.csv");
        let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("opens");
        grantpt(&controller).expect("grants");
        unlockpt(&controller).expect("unlocks");
        let device = ptsname(&controller, Vec::new()).expect("has a name").into_string().expect("is text");
        let mut log = start(&format!("serial://{device}?baud=460800"), &path);
        let mut controller = File::from(controller);
        // Control characters pass unchanged, and a line may arrive in pieces.
        controller.write_all(b"1,0,0,9.81,0,0,0\r\n2,0,\x03\x11").expect("writes");
        assert_eq!(next(&mut log), "1,0,0,9.81,0,0,0\r");
        controller.write_all(b",9\n3,half").expect("writes");
        assert_eq!(next(&mut log), "2,0,\x03\x11,9");
        wait_for(|| std::fs::read(&path).expect("reads").ends_with(b"3,half").then_some(()));
        drop(controller);
        wait_for(|| (log.n_interruptions() > 0).then_some(()));
        assert!(log.take_error().is_none());
        log.close();
        assert_eq!(next(&mut log), "3,half");
        assert_eq!(std::fs::read(&path).expect("reads"), b"1,0,0,9.81,0,0,0\r\n2,0,\x03\x11,9\n3,half");
    }
}
