//! The receiving thread: from the sockets into the capture.
//!
//! It waits only for the sensor and the disk. The decoder reads the capture.

use super::drops::dropped;
use super::now;
use crate::error::LiveError;
use lidar::pcap::{Frontier, Recorder};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::sockopt::{set_socket_recv_buffer_size, set_socket_recv_buffer_size_force, socket_recv_buffer_size};
use std::io;
use std::net::{SocketAddr, SocketAddrV4, UdpSocket};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Requested size of the kernel's receive buffer, for stalls of the disk: about four seconds of an HDL-32E.
const BUFFER: usize = 8 << 20;
/// Interval at which packets are written to the file, where the decoder reads them and a crash does not lose them. Shorter intervals
/// only cost system calls.
const FLUSH: Duration = Duration::from_millis(5);
/// Interval at which the thread checks whether to stop.
const IDLE: Duration = Duration::from_millis(50);
/// Packets taken from one socket before the other one is read.
const BURST: usize = 64;
/// Packets that a full buffer of [`BUFFER`] may hold, with a margin. It limits the final read, however fast the sensor
/// sends.
const MAX_HELD: usize = 16_384;
/// The largest UDP packet.
const MAX_PACKET: usize = 65_536;

/// The bound sockets of a sensor.
#[derive(Debug)]
pub(crate) struct Sockets {
    all: Vec<BoundSocket>,
}

/// A socket and the address to which it is bound.
#[derive(Debug)]
pub struct BoundSocket {
    /// The socket.
    pub socket: UdpSocket,
    /// Its address.
    pub address: SocketAddrV4,
}

impl Sockets {
    /// Binds the sockets; the first one is for data packets.
    pub(crate) fn bind(addresses: &[SocketAddrV4]) -> Result<Self, LiveError> {
        Ok(Self { all: addresses.iter().map(|address| bind(*address)).collect::<Result<_, _>>()? })
    }

    /// Size of the kernel's receive buffer of the data socket, with bookkeeping.
    pub(crate) fn buffer_bytes(&self) -> usize {
        self.all.first().and_then(|bound| socket_recv_buffer_size(&bound.socket).ok()).unwrap_or_default()
    }
}

/// The address in a text such as `127.0.0.1:2368`.
pub fn address(text: &str) -> Result<SocketAddrV4, LiveError> {
    text.parse().map_err(|_| LiveError::Address(text.to_owned()))
}

/// Binds a non-blocking socket.
pub fn bind(address: SocketAddrV4) -> Result<BoundSocket, LiveError> {
    let bound = || -> io::Result<BoundSocket> {
        let socket = UdpSocket::bind(address)?;
        socket.set_nonblocking(true)?;
        // The first call needs a privilege; the second is limited by net.core.rmem_max. A smaller buffer also works.
        if set_socket_recv_buffer_size_force(&socket, BUFFER).is_err() {
            let _ = set_socket_recv_buffer_size(&socket, BUFFER);
        }
        Ok(BoundSocket { socket, address })
    };
    bound().map_err(|source| LiveError::Bind { address, source })
}

/// Handle of the thread.
pub(crate) struct Receiver {
    /// `None` after the end.
    sockets: Option<Arc<Sockets>>,
    frontier: Frontier,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    /// Packets dropped by the kernel so far, and how many of them have been reported.
    n_dropped: u64,
    n_dropped_reported: u64,
}

#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    n_packets: AtomicU64,
    /// Time from the first to the last packet.
    span_millis: AtomicU64,
    silent_millis: AtomicU64,
    error: Mutex<Option<io::Error>>,
    /// Notified when the file has grown. The thread never takes the lock, so a notification may be missed; waits are short.
    has_grown: Condvar,
    has_grown_lock: Mutex<()>,
}

impl Receiver {
    /// Starts the thread.
    pub(crate) fn start(sockets: Sockets, recorder: Recorder) -> io::Result<Self> {
        let sockets = Arc::new(sockets);
        let shared = Arc::new(Shared::default());
        let frontier = recorder.frontier();
        let thread = std::thread::Builder::new().name("receiver".to_owned());
        let of_thread = Arc::clone(&shared);
        let sockets_of_thread = Arc::clone(&sockets);
        let thread = thread.spawn(move || {
            if let Err(error) = receive(&sockets_of_thread, recorder, &of_thread) {
                *of_thread.error.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
            of_thread.has_grown.notify_all();
        })?;
        Ok(Self { sockets: Some(sockets), frontier, shared, thread: Some(thread), n_dropped: 0, n_dropped_reported: 0 })
    }

    /// Size of the kernel's receive buffer, bytes.
    pub(crate) fn buffer_bytes(&self) -> usize {
        self.sockets.as_ref().map_or(0, |sockets| sockets.buffer_bytes())
    }

    /// The written part of the capture.
    pub(crate) fn frontier(&self) -> &Frontier {
        &self.frontier
    }

    /// The bound addresses.
    pub(crate) fn addresses(&self) -> String {
        let all = self.sockets.iter().flat_map(|sockets| &sockets.all);
        all.map(|bound| bound.address.to_string()).collect::<Vec<_>>().join(" and ")
    }

    /// Packets received so far from any sender.
    pub(crate) fn n_packets(&self) -> u64 {
        self.shared.n_packets.load(Ordering::Relaxed)
    }

    /// The error that ended the thread, if it failed.
    pub(crate) fn take_error(&self) -> Option<io::Error> {
        let has_ended = self.thread.as_ref().is_some_and(JoinHandle::is_finished);
        let error = self.shared.error.lock().unwrap_or_else(PoisonError::into_inner).take();
        has_ended.then(|| error.unwrap_or_else(|| io::Error::other("the receiving thread panicked")))
    }

    /// Time since the last packet, before the first one since the start, s. It does not grow while the thread waits for the disk.
    pub(crate) fn silent_s(&self) -> f64 {
        self.shared.silent_millis.load(Ordering::Relaxed) as f64 * 1e-3
    }

    /// Time from the first to the last packet, s.
    pub(crate) fn span_s(&self) -> f64 {
        self.shared.span_millis.load(Ordering::Relaxed) as f64 * 1e-3
    }

    /// Packets dropped by the kernel since the last call.
    pub(crate) fn take_dropped(&mut self) -> u64 {
        self.update_dropped();
        let before = std::mem::replace(&mut self.n_dropped_reported, self.n_dropped);
        self.n_dropped.saturating_sub(before)
    }

    fn update_dropped(&mut self) {
        if let Some(sockets) = &self.sockets {
            self.n_dropped = sockets.all.iter().filter_map(|bound| dropped(&bound.socket)).sum();
        }
    }

    /// Waits a short time for the file to grow. `false` from `until` on.
    pub(crate) fn wait(&self, until: Instant) -> bool {
        let left = until.saturating_duration_since(Instant::now()).min(2 * FLUSH);
        if left.is_zero() {
            return false;
        }
        let lock = self.shared.has_grown_lock.lock().unwrap_or_else(PoisonError::into_inner);
        drop(self.shared.has_grown.wait_timeout(lock, left));
        true
    }

    /// Ends the thread, which first reads the kernel's receive buffer. Then the capture is complete.
    pub(crate) fn close(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread is on stderr.
            let _ = thread.join();
        }
        self.update_dropped();
        self.sockets = None;
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        self.close();
    }
}

fn receive(sockets: &Sockets, mut recorder: Recorder, shared: &Shared) -> io::Result<()> {
    let mut packet = vec![0; MAX_PACKET];
    let mut flushed = Instant::now();
    let mut first_packet = None;
    let mut last_packet = Instant::now();
    while !shared.stop.load(Ordering::Relaxed) {
        let timeout = if recorder.has_unwritten() { FLUSH } else { IDLE };
        let mut n_packets = 0;
        for (is_ready, bound) in wait_for_packets(sockets, timeout)?.into_iter().zip(&sockets.all) {
            if is_ready {
                n_packets += take_burst(&bound.socket, bound.address, BURST, &mut packet, &mut recorder)?;
            }
        }
        shared.n_packets.fetch_add(n_packets, Ordering::Relaxed);
        if n_packets > 0 {
            let now = Instant::now();
            last_packet = now;
            let span = now - *first_packet.get_or_insert(now);
            shared.span_millis.store(span.as_millis() as u64, Ordering::Relaxed);
        }
        shared.silent_millis.store(last_packet.elapsed().as_millis() as u64, Ordering::Relaxed);
        if recorder.has_unwritten() && flushed.elapsed() >= FLUSH {
            recorder.flush()?;
            flushed = Instant::now();
            shared.has_grown.notify_all();
        }
    }
    for BoundSocket { socket, address } in &sockets.all {
        let n_packets = take_burst(socket, *address, MAX_HELD, &mut packet, &mut recorder)?;
        shared.n_packets.fetch_add(n_packets, Ordering::Relaxed);
    }
    recorder.flush()
}

/// Waits for packets. Returns for each socket whether it has packets.
fn wait_for_packets(sockets: &Sockets, timeout: Duration) -> io::Result<Vec<bool>> {
    let mut descriptors: Vec<PollFd<'_>> =
        sockets.all.iter().map(|bound| PollFd::new(&bound.socket, PollFlags::IN)).collect();
    let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(timeout.subsec_nanos()) };
    match poll(&mut descriptors, Some(&timeout)) {
        Ok(_) => Ok(descriptors.iter().map(|descriptor| !descriptor.revents().is_empty()).collect()),
        Err(rustix::io::Errno::INTR) => Ok(vec![false; sockets.all.len()]),
        Err(error) => Err(error.into()),
    }
}

/// Records the waiting packets, at most `limit`. Returns their number.
fn take_burst(
    socket: &UdpSocket,
    address: SocketAddrV4,
    limit: usize,
    packet: &mut [u8],
    recorder: &mut Recorder,
) -> io::Result<u64> {
    for n in 0..limit {
        match socket.recv_from(packet) {
            Ok((length, SocketAddr::V4(source))) => recorder.write(now(), source, address, &packet[..length])?,
            // An IPv4 socket receives only from IPv4 senders.
            Ok((_, SocketAddr::V6(_))) => {}
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(n as u64),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(limit as u64)
}
