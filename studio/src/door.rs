//! Interface of a page to the engine: WebAssembly without generated glue. There are two exports, two imports of the module
//! `page`, and `memory`.
//!
//! A page calls `reserve(json, binary)`, writes the JSON of a request and then its bytes to the returned address, and calls
//! `request()`. During this call the engine calls `answer` with JSON and bytes, once for each answer. Memory may grow in both
//! calls, which invalidates earlier views of it. A panic ends in `panicked` and a trap; afterwards the instance is unusable.

#![allow(unsafe_code)] // Exports and imports have names of their own. No block here is unsafe.

use crate::Session;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::sync::Once;

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Receives an answer: addresses and lengths of its JSON and its bytes.
    safe fn answer(json: *const u8, json_len: usize, binary: *const u8, binary_len: usize);
    /// Receives the message of a panic: its address and length.
    safe fn panicked(words: *const u8, len: usize);
}

/// Buffer into which the page writes a request.
#[derive(Default)]
struct RequestBuffer {
    bytes: Vec<u8>,
    json_len: usize,
}

thread_local! {
    static ROOM: RefCell<RequestBuffer> = RefCell::default();
    static SESSION: RefCell<Session> = RefCell::default();
}

static HOOK: Once = Once::new();

/// Allocates memory for a request and returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(json_len: usize, binary_len: usize) -> *mut u8 {
    HOOK.call_once(|| {
        std::panic::set_hook(Box::new(|panic| {
            let words = panic.to_string();
            panicked(words.as_ptr(), words.len());
        }));
    });
    ROOM.with_borrow_mut(|room| {
        *room = RequestBuffer { bytes: vec![0; json_len + binary_len], json_len };
        room.bytes.as_mut_ptr()
    })
}

/// Answers the request in the buffer.
#[unsafe(no_mangle)]
pub extern "C" fn request() {
    let RequestBuffer { bytes, json_len } = ROOM.take();
    let (json, binary) = bytes.split_at(json_len);
    let json = String::from_utf8_lossy(json);
    SESSION.with_borrow_mut(|session| {
        session.request(&json, binary, &mut |json, bytes| {
            answer(json.as_ptr(), json.len(), bytes.as_ptr(), bytes.len());
            ControlFlow::Continue(())
        });
    });
}
