// The report's script: a classic one, so that it runs from file://. All is readable without it.

import { offerApproval, showApprovals } from "./approvals";
import type { CaseData } from "./case";
import { bindCaseKeys, startCase } from "./casepage";
import { dataBlock } from "./dom";
import { bind, helpDialog, listen } from "./keys";
import { startMatrix } from "./matrix";
import { startSingle } from "./single";

document.documentElement.classList.add("scripted");

function start(): void {
  startSingle();
  const data = dataBlock<CaseData>("case-data");
  const run = document.querySelector<HTMLMetaElement>('meta[name="snellcheck-run"]')?.content ?? "";
  let help: HTMLDialogElement | null = null;
  const toggleHelp = (): void => {
    help ??= helpDialog();
    if (help.open) help.close();
    else help.showModal();
  };
  if (data) {
    bindCaseKeys(data, document);
    offerApproval(run, data.id, document);
    void startCase(data, document);
  } else {
    startMatrix();
    showApprovals(run);
  }
  bind("Everywhere", "?", "these keys", ["?"], toggleHelp);
  document.getElementById("help")?.addEventListener("click", toggleHelp);
  listen();
}

if (document.readyState === "loading") addEventListener("DOMContentLoaded", start);
else start();
