// A USB host on the controller of rp2040js. It resets the bus, enumerates the device, opens its serial port as a terminal does,
// and reads the port from a given time on. It does not set the line coding, suspend the bus, or unplug the device.
//
// The requests are defined in USB 2.0, section 9.4, and in its class for communication devices (PSTN 1.2, section 6.3.12).

const DEVICE = 1, CONFIGURATION = 2, STRING = 3, ENDPOINT = 5, INTERFACE = 4;
const ENGLISH = 0x0409, DATA_CLASS = 10, BULK = 2;
const DELAY_NS = 100_000;
const PACKET_NS = 52_632; // at most 19 packets of 64 bytes in a frame of 1 ms (USB 2.0, table 5-9)
const AVAILABLE = 1 << 10; // bit of a buffer control register (RP2040 data sheet, section 4.1.4)

const read = (type, request, value, index, length) => ({ bytes: [type | 0x80, request, value, index, length], length });
const write = (type, request, value, index) => ({ bytes: [type, request, value, index, 0], length: 0 });
const descriptor = (kind, number, length, language = 0) => read(0, 6, (kind << 8) | number, language, length);

/// Connects a host that reads the port from `readsFrom` on, in ns. `found` is called with the text of the descriptors, `received` with
/// the bytes of each packet. Returns the function that sends text to the port.
export const connect = (mcu, clock, readsFrom, found, received) => {
  const usb = mcu.usbCtrl;
  let control, answer = [], inEndpoint = -1, outEndpoint = -1, pending = [];
  const ready = new Map(); // number of bytes that each endpoint accepts, if it accepts any

  // Each `yield` sends a request; its value is the answer.
  function* enumerate() {
    yield write(0, 5, 1, 0); // SET_ADDRESS
    const device = Buffer.from(yield descriptor(DEVICE, 0, 18));
    const strings = [];
    for (const field of [14, 15, 16]) {
      const bytes = yield descriptor(STRING, device[field], 255, ENGLISH);
      strings.push(Buffer.from(bytes.slice(2)).toString('utf16le'));
    }
    const head = yield descriptor(CONFIGURATION, 0, 9);
    const configuration = yield descriptor(CONFIGURATION, 0, head[2] | (head[3] << 8));
    let isData = false;
    for (let at = 0; at < configuration.length; at += configuration[at]) {
      const [, kind, address, attributes, , interfaceClass] = configuration.slice(at, at + 6);
      if (kind === INTERFACE) isData = interfaceClass === DATA_CLASS;
      if (kind === ENDPOINT && isData && (attributes & 3) === BULK) {
        if (address & 0x80) inEndpoint = address & 0xf;
        else outEndpoint = address & 0xf;
      }
    }
    yield write(0, 9, configuration[5], 0); // SET_CONFIGURATION
    yield write(0x21, 0x22, 3, 0); // SET_CONTROL_LINE_STATE: DTR and RTS, as when a terminal opens the port
    const hexadecimal = (field) => device.readUInt16LE(field).toString(16).padStart(4, '0');
    found(`${hexadecimal(8)}:${hexadecimal(10)} ${strings.join(', ')}, ${2 * configuration[8]} mA`);
  }
  let requests;
  const proceed = () => {
    control = requests.next(answer).value;
    answer = [];
    if (!control) return;
    const [type, code, value, index, length] = control.bytes;
    const packet = [type, code, value & 0xff, value >> 8, index & 0xff, index >> 8, length & 0xff, length >> 8];
    clock.createAlarm(() => usb.sendSetupPacket(new Uint8Array(packet))).schedule(DELAY_NS);
  };

  usb.onUSBEnabled = () => usb.resetDevice();
  usb.onResetReceived = () => {
    requests = enumerate();
    proceed();
  };
  usb.onEndpointWrite = (endpoint, buffer) => {
    if (endpoint === inEndpoint) received(buffer);
    if (endpoint !== 0 || !control) return;
    answer.push(...buffer);
    if (buffer.length === 64 && answer.length < control.length) return;
    proceed();
  };
  const send = () => {
    if (!ready.has(outEndpoint) || pending.length === 0) return;
    usb.endpointReadDone(outEndpoint, new Uint8Array(pending.splice(0, ready.get(outEndpoint))));
    ready.delete(outEndpoint);
  };
  usb.onEndpointRead = (endpoint, size) => {
    ready.set(endpoint, size);
    send();
  };
  // The controller of rp2040js takes a packet at once. Here the packet waits until the host reads, and for its place in a frame.
  const updated = usb.DPRAMUpdated.bind(usb);
  usb.DPRAMUpdated = (offset, value) => {
    if (offset !== 0x80 + 8 * inEndpoint || !(value & AVAILABLE)) updated(offset, value);
    else if (Number.isFinite(readsFrom)) {
      const at = Math.max(readsFrom + 1, clock.nanos + PACKET_NS);
      clock.createAlarm(() => updated(offset, value)).schedule(at - clock.nanos);
    }
  };
  return (keys) => {
    pending.push(...Buffer.from(keys));
    send();
  };
};
