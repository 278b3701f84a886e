// Connection to the server; it is opened again when it is lost.

import type { Message } from "./messages";

const RETRY_MS = 1000;
const LOOK_MS = 1000;
const SILENT_LOOKS = 5;
const TOO_MANY = 1013; // WSCloseCode.TRY_AGAIN_LATER

export interface Receiver {
  onMessage(message: Message): void;
  onSamples(data: ArrayBuffer): void;
  onLost(reason: string): void;
}

export function connect(receiver: Receiver): void {
  const socket = new WebSocket(`ws://${location.host}/ws${location.search}`);
  socket.binaryType = "arraybuffer";
  let watch: ReturnType<typeof setInterval> | undefined;
  let silentLooks = 0; // looks and not seconds: after a stall of this page messages wait to be read
  const end = (reason: string): void => {
    clearInterval(watch);
    socket.onmessage = socket.onclose = null;
    socket.close();
    receiver.onLost(reason);
    setTimeout(() => connect(receiver), RETRY_MS);
  };
  // Of a cable that was pulled a browser hears nothing for minutes; robotd sends each second.
  const look = (): void => {
    silentLooks += 1;
    if (silentLooks > SILENT_LOOKS) end(`Nothing has come from robotd for ${SILENT_LOOKS} s`);
  };
  socket.onopen = () => {
    watch = setInterval(look, LOOK_MS);
  };
  socket.onmessage = ({ data }) => {
    silentLooks = 0;
    if (typeof data === "string") receiver.onMessage(JSON.parse(data) as Message);
    else receiver.onSamples(data as ArrayBuffer);
  };
  socket.onclose = ({ code, reason }) => end(code === TOO_MANY ? reason : "The connection to robotd is lost");
}
