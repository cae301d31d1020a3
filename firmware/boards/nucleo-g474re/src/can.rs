//! CAN driver: FDCAN 1 at 250 kbit/s (SAE J1939-11), with queues served by its interrupts.

use embassy_stm32::Peri;
use embassy_stm32::can::config::{GlobalFilter, NonMatchingFilter};
use embassy_stm32::can::{
    BufferedCanReceiver, BufferedCanSender, CanConfigurator, IT0InterruptHandler, IT1InterruptHandler, RxBuf,
    TxBuf, frame,
};
use embassy_stm32::interrupt::typelevel::{self, Binding};
use embassy_stm32::peripherals::{FDCAN1, PA11, PA12};
use kou_app::controller::CanPort;
use kou_app::j1939::Frame;
use static_cell::ConstStaticCell;

/// Bit rate of J1939-11, and of most vehicles.
const BIT_RATE: u32 = 250_000;
/// Queue length in either direction: the frames of one cycle of the publishing task, with a margin.
const QUEUE: usize = 16;

static TO_BUS: ConstStaticCell<TxBuf<QUEUE>> = ConstStaticCell::new(TxBuf::new());
static FROM_BUS: ConstStaticCell<RxBuf<QUEUE>> = ConstStaticCell::new(RxBuf::new());

/// CAN port of the controller.
pub(crate) struct FdcanPort {
    sender: BufferedCanSender,
    receiver: BufferedCanReceiver,
}

impl FdcanPort {
    /// Starts the peripheral; `None` at a second call, because the queues exist once.
    pub(crate) fn new(
        can: Peri<'static, FDCAN1>,
        receive: Peri<'static, PA11>,
        send: Peri<'static, PA12>,
        irqs: impl Binding<typelevel::FDCAN1_IT0, IT0InterruptHandler<FDCAN1>>
        + Binding<typelevel::FDCAN1_IT1, IT1InterruptHandler<FDCAN1>>
        + 'static,
    ) -> Option<Self> {
        let (to_bus, from_bus) = (TO_BUS.try_take()?, FROM_BUS.try_take()?);
        let mut configurator = CanConfigurator::new(can, receive, send, irqs);
        configurator.set_bitrate(BIT_RATE);
        // 11-bit and remote frames are not used by J1939, and not worth an interrupt.
        let filter = GlobalFilter::reject_all().set_handle_extended_frames(NonMatchingFilter::IntoRxFifo0);
        configurator.set_config(configurator.config().set_global_filter(filter));
        let buffered = configurator.into_normal_mode().buffered(to_bus, from_bus);
        Some(Self { sender: buffered.writer(), receiver: buffered.reader() })
    }
}

impl CanPort for FdcanPort {
    fn receive(&mut self) -> Option<Frame> {
        // Bus errors come in the same queue; their effect shows in the frames that do not arrive.
        while let Ok(come) = self.receiver.try_receive() {
            if let Some(frame) = come.ok().and_then(|envelope| Frame::from_can(&envelope.frame)) {
                return Some(frame);
            }
        }
        None
    }

    fn send(&mut self, frame: &Frame) -> bool {
        let frame: Option<frame::Frame> = frame.to_can();
        frame.is_some_and(|frame| self.sender.try_write(frame).is_ok())
    }
}
