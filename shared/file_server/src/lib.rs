//! Serves a fixed set of files to browsers on this machine: HTTP/1.1, GET and HEAD, single byte ranges, persistent connections.
//!
//! | idea | module |
//! |---|---|
//! | served contents, by name | [`Site`], [`Content`] |
//! | bytes of a request | `request`, `range` |
//! | bytes of a response | `response` |
//! | one client, and all clients | `connection`, [`Server`] |
//!
//! A name that is not in the [`Site`] does not exist: no request becomes a path of the file system. Connections, the size of a request and
//! all waits are limited. Nothing is encrypted; the server is meant for loopback.
//!
//! What it must never do: write, follow a path that a client names, listen on another interface than the caller
//! requested, or block the program on a slow client. It is independent of clouds: `replica view` decides what is served.
//!
//! Where to start reading: [`Site`] is the fixed set of names, [`Server`] accepts clients, `connection` answers the
//! requests of one client.
//!
//! `tiny_http` 0.12 has neither byte ranges nor limits of connections, so most of this code would be needed in addition
//! to it.

mod connection;
mod range;
mod request;
mod response;
mod server;
mod site;

pub use server::Server;
pub use site::{Content, Site, SiteError};
