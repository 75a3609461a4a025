//! Whether there is anything to draw with.

use crate::core_tests::beside::is_required;
use eframe::wgpu;
use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

/// Whether there is anything to draw with, a software adapter included; says so when there is not.
pub fn has_adapter() -> bool {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let mut search = pin!(instance.enumerate_adapters(wgpu::Backends::all()));
    let found = loop {
        if let Poll::Ready(adapters) = search.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            break !adapters.is_empty();
        }
    };
    if !found {
        assert!(!is_required("adapter"), "no graphics adapter, and PATINA_REQUIRE asks for one");
        println!("skipped: no graphics adapter");
    }
    found
}

/// What the window shows. The harness waits for a picture no longer than some seconds, which a software adapter on a busy
/// machine may need more of: it is asked again then, since how long a picture takes decides nothing.
pub fn rendered<State>(harness: &mut egui_kittest::Harness<'_, State>) -> Result<image::RgbaImage, String> {
    const MOST_TIMES: usize = 40;
    for _ in 1..MOST_TIMES {
        match harness.render() {
            Err(reason) if reason.contains("timed out") => {}
            other => return other,
        }
    }
    harness.render()
}
