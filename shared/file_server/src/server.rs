//! The server and all its clients.

use crate::connection::{self, Hosts};
use crate::response::{Refusal, refuse};
use crate::site::Site;
use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{self, Scope};
use std::time::Duration;

/// Maximum number of clients at a time. A browser opens six connections to a host.
const MAX_CONNECTIONS: usize = 64;
/// Maximum number of clients of one host, so that one host does not keep the others out.
const MAX_CONNECTIONS_PER_HOST: usize = 32;
/// Interval at which the server checks for a new client and for its stop signal.
const POLL: Duration = Duration::from_millis(20);

/// A server bound to its address; it accepts clients while it runs.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
}

impl Server {
    /// Binds an address; with port 0 the system chooses a free one.
    pub fn bind(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self { address: listener.local_addr()?, listener })
    }

    /// The address on which the server listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves clients until `is_stopped`. Errors of clients end their connections only.
    pub fn run(&self, site: &Site, is_stopped: impl Fn() -> bool + Sync) {
        let hosts = if self.address.ip().is_loopback() { Hosts::Loopback } else { Hosts::Any };
        let connections = Connections::default();
        let is_stopped = &is_stopped;
        thread::scope(|scope| {
            while !is_stopped() {
                match self.listener.accept() {
                    Ok((stream, client)) => {
                        let serve = move |stream: &TcpStream| connection::serve(stream, site, hosts, is_stopped);
                        if start(scope, connections.enter(client.ip()), stream, serve).is_err() {
                            thread::sleep(POLL);
                        }
                    }
                    // Also happens with too many open files: some of them will be closed.
                    Err(_) => thread::sleep(POLL),
                }
            }
        });
    }
}

/// Serves a client in a thread of its own. An error, for example of a system without more threads, ends this connection.
fn start<'scope>(
    scope: &'scope Scope<'scope, '_>,
    place: Option<Place<'scope>>,
    stream: TcpStream,
    serve: impl FnOnce(&TcpStream) -> io::Result<()> + Send + 'scope,
) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    let Some(place) = place else {
        // The client may have disconnected.
        let _ = refuse(&mut &stream, Refusal::TooManyConnections, true);
        return Ok(());
    };
    thread::Builder::new().name("client".to_owned()).spawn_scoped(scope, move || {
        let _place = place;
        // The client has disconnected or is too slow, so the error cannot be reported to it.
        let _ = serve(&stream);
    })?;
    Ok(())
}

/// Number of clients of each host.
#[derive(Default)]
struct Connections(Mutex<BTreeMap<IpAddr, usize>>);

impl Connections {
    /// A place for a client of this host; `None` if all are taken.
    fn enter(&self, host: IpAddr) -> Option<Place<'_>> {
        let mut numbers = self.numbers();
        let n_all: usize = numbers.values().sum();
        let n_host = numbers.get(&host).copied().unwrap_or_default();
        if n_all >= MAX_CONNECTIONS || n_host >= MAX_CONNECTIONS_PER_HOST {
            return None;
        }
        numbers.insert(host, n_host + 1);
        Some(Place { connections: self, host })
    }

    fn numbers(&self) -> MutexGuard<'_, BTreeMap<IpAddr, usize>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One of the connections. It is released even when a content panics.
struct Place<'a> {
    connections: &'a Connections,
    host: IpAddr,
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        let mut numbers = self.connections.numbers();
        match numbers.get_mut(&self.host) {
            Some(n_host) if *n_host > 1 => *n_host -= 1,
            _ => drop(numbers.remove(&self.host)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_host_leaves_places_for_others() {
        let connections = Connections::default();
        let [first, second, third] = [1, 2, 3].map(|last| IpAddr::from([192, 168, 0, last]));
        let enter = |host: IpAddr| std::iter::from_fn(|| connections.enter(host)).take(100).collect::<Vec<_>>();
        let of_first = enter(first);
        let of_second = enter(second);
        assert_eq!((of_first.len(), of_second.len(), enter(third).len()), (32, 32, 0));
        drop(of_first);
        assert_eq!(enter(third).len(), 32);
        drop(of_second);
        assert!(connections.numbers().is_empty());
    }
}
