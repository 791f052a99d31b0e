//! The door of a page: WebAssembly without generated glue. Two exports, two imports of the module `page`, and `memory`.
//!
//! A page calls `reserve(json, binary)`, writes a request's JSON and then its bytes to where that points, and calls `request()`,
//! during which `answer` is called for every answer with JSON and bytes. Memory may grow in both calls, so that views of it
//! made before are void. A panic ends in `panicked` and a trap; the instance is spent then.

#![allow(unsafe_code)] // Exports and imports have names of their own. No block here is unsafe.

use crate::Session;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::sync::Once;

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// An answer: where its JSON and its bytes are, and how long.
    safe fn answer(json: *const u8, json_len: usize, binary: *const u8, binary_len: usize);
    /// The words of a panic: where they are, and how long.
    safe fn panicked(words: *const u8, len: usize);
}

/// A request as the page writes it.
#[derive(Default)]
struct Room {
    bytes: Vec<u8>,
    json_len: usize,
}

thread_local! {
    static ROOM: RefCell<Room> = RefCell::default();
    static SESSION: RefCell<Session> = RefCell::default();
}

static HOOK: Once = Once::new();

/// Makes room for a request; returns where.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(json_len: usize, binary_len: usize) -> *mut u8 {
    HOOK.call_once(|| {
        std::panic::set_hook(Box::new(|panic| {
            let words = panic.to_string();
            panicked(words.as_ptr(), words.len());
        }));
    });
    ROOM.with_borrow_mut(|room| {
        *room = Room { bytes: vec![0; json_len + binary_len], json_len };
        room.bytes.as_mut_ptr()
    })
}

/// Answers the request that was written.
#[unsafe(no_mangle)]
pub extern "C" fn request() {
    let Room { bytes, json_len } = ROOM.take();
    let (json, binary) = bytes.split_at(json_len);
    let json = String::from_utf8_lossy(json);
    SESSION.with_borrow_mut(|session| {
        session.request(&json, binary, &mut |json, bytes| {
            answer(json.as_ptr(), json.len(), bytes.as_ptr(), bytes.len());
            ControlFlow::Continue(())
        });
    });
}
